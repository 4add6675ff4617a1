-- What the reports of each cohort tell, by number of vehicles in transport: how much of it can be reconstructed at all.
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
ORDER BY crashes.cohort, told.moving;

COMMENT ON VIEW usable_information IS 'What the reports tell of the collisions of two vehicles within their cohort''s filters';
COMMENT ON COLUMN usable_information.cohort IS 'Cohort';
COMMENT ON COLUMN usable_information.vehicles IS 'Motor vehicles in transport that the report lists';
COMMENT ON COLUMN usable_information.crashes IS 'Crashes whose report was read, filters passed, two vehicles known to have met';
COMMENT ON COLUMN usable_information.topology IS 'Of those, not rejected as incomplete_topology';
COMMENT ON COLUMN usable_information.trajectory IS 'Of those, not rejected as incomplete_trajectory';
COMMENT ON COLUMN usable_information.impact IS 'Of those, with an area of impact of every vehicle';
COMMENT ON COLUMN usable_information.speed IS 'Of those, with a reported speed of every vehicle';
