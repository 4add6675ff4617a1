-- The typing of crashes with pedestrians and cyclists: how many persons and crashes are of each group, empty ones too.
CREATE VIEW person_crash_groups AS
WITH typed AS (
    UNPIVOT (SELECT key, pedestrian_group_code AS PEDCGP, cyclist_group_code AS BIKECGP FROM non_motorists)
    ON PEDCGP, BIKECGP
    INTO NAME element VALUE code
)
SELECT
    codes.element,
    codes.code,
    codes.meaning,
    count(typed.key) AS persons,
    count(DISTINCT typed.key) AS registered,
    count(DISTINCT typed.key) FILTER (crashes.final_state = 'verified') AS verified
FROM codes
LEFT JOIN typed USING (element, code)
LEFT JOIN crashes USING (key)
WHERE codes.element IN ('PEDCGP', 'BIKECGP')
GROUP BY codes.element, codes.code, codes.meaning
ORDER BY codes.element DESC, codes.code;

COMMENT ON VIEW person_crash_groups IS 'Crashes with pedestrians and cyclists by the group of their crash type';
COMMENT ON COLUMN person_crash_groups.element IS 'PEDCGP of pedestrians, BIKECGP of cyclists';
COMMENT ON COLUMN person_crash_groups.code IS 'Code of the group';
COMMENT ON COLUMN person_crash_groups.meaning IS 'The group in words';
COMMENT ON COLUMN person_crash_groups.persons IS 'Persons typed so, in reports that were read';
COMMENT ON COLUMN person_crash_groups.registered IS 'Crashes with such a person';
COMMENT ON COLUMN person_crash_groups.verified IS 'Verified crashes with such a person';
