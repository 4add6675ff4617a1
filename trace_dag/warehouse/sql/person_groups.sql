-- The groups that the typing of crashes with pedestrians and cyclists knows.
CREATE TABLE person_groups AS
SELECT element, code, meaning
FROM person_group
ORDER BY element DESC, code;

COMMENT ON TABLE person_groups IS 'The groups of the pedestrian and bicycle crash typing';
COMMENT ON COLUMN person_groups.element IS 'PEDCGP of pedestrians, BIKECGP of cyclists';
COMMENT ON COLUMN person_groups.code IS 'Code of the group';
COMMENT ON COLUMN person_groups.meaning IS 'The group in words';
