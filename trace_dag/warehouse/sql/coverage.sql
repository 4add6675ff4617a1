-- How the crashes cover each class of the three dimensions; classes without any crash are listed too. Crashes whose
-- report could not be read are in no class.
CREATE VIEW coverage AS
WITH classes AS (
    UNPIVOT (SELECT key, final_state, collision_type, road_topology, vehicle_trajectory FROM crashes)
    ON collision_type, road_topology, vehicle_trajectory
    INTO NAME dimension VALUE class
)
SELECT
    coverage_classes.dimension,
    coverage_classes.class,
    count(classes.key) AS registered,
    count(classes.key) FILTER (final_state = 'verified') AS verified,
    any_value(coverage_classes.published) AS published
FROM coverage_classes
LEFT JOIN classes USING (dimension, class)
GROUP BY coverage_classes.dimension, coverage_classes.class, class_number
ORDER BY class_number;

COMMENT ON VIEW coverage IS 'Numbers of crashes in each class of the three dimensions, empty classes included';
COMMENT ON COLUMN coverage.dimension IS 'collision_type, road_topology or vehicle_trajectory';
COMMENT ON COLUMN coverage.class IS 'Class of the dimension';
COMMENT ON COLUMN coverage.registered IS 'Crashes of that class, whatever became of them';
COMMENT ON COLUMN coverage.verified IS 'Verified crashes of that class';
COMMENT ON COLUMN coverage.published IS 'Cases of that class in the published benchmark';
