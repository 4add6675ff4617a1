-- What the reports of each cohort tell, by kind of crash and number of vehicles in transport: how much of it can be
-- reconstructed at all.
CREATE VIEW usable_information AS
WITH told AS (
    SELECT
        vehicles.key,
        count(*) AS moving,
        bool_and(impact_clock_h IS NOT NULL) AS impact,
        bool_and(travel_speed_mps IS NOT NULL) AS speed
    FROM vehicles
    WHERE in_transport
    GROUP BY vehicles.key
)
SELECT
    crashes.cohort,
    crashes.kind,
    told.moving AS vehicles,
    count(*) AS crashes,
    count(*) FILTER (crashes.reason IS DISTINCT FROM 'incomplete_topology') AS topology,
    count(*) FILTER (crashes.reason IS DISTINCT FROM 'incomplete_trajectory') AS trajectory,
    count(*) FILTER (told.impact) AS impact,
    count(*) FILTER (told.speed) AS speed
FROM crashes
JOIN told USING (key)
WHERE coalesce(crashes.reason NOT IN ('outside_cohort', 'not_modelled', 'incomplete_sequence'), TRUE)
GROUP BY ALL
ORDER BY crashes.cohort, crashes.kind, told.moving;

COMMENT ON VIEW usable_information IS 'Information in the reports of crashes that can be judged, within their cohort''s filters';
COMMENT ON COLUMN usable_information.cohort IS 'Cohort';
COMMENT ON COLUMN usable_information.kind IS 'Kind of crash';
COMMENT ON COLUMN usable_information.vehicles IS 'Motor vehicles in transport that the report lists';
COMMENT ON COLUMN usable_information.crashes IS 'Crashes with a readable report and known parties, of a kind that can be judged, within the filters';
COMMENT ON COLUMN usable_information.topology IS 'Of those, not rejected as incomplete_topology';
COMMENT ON COLUMN usable_information.trajectory IS 'Of those, not rejected as incomplete_trajectory';
COMMENT ON COLUMN usable_information.impact IS 'Of those, with an area of impact of every vehicle';
COMMENT ON COLUMN usable_information.speed IS 'Of those, with a reported speed of every vehicle';
