-- How the crashes of each kind cover the classes of the three dimensions: the combinations that occur.
CREATE VIEW coverage_by_kind AS
WITH classes AS (
    UNPIVOT (
        SELECT key, coalesce(kind, 'not_known') AS kind, final_state, collision_type, road_topology, vehicle_trajectory
        FROM crashes
    )
    ON collision_type, road_topology, vehicle_trajectory
    INTO NAME dimension VALUE class
)
SELECT
    classes.kind,
    coverage_classes.dimension,
    coverage_classes.class,
    count(*) AS registered,
    count(*) FILTER (final_state = 'verified') AS verified
FROM classes
JOIN coverage_classes USING (dimension, class)
GROUP BY classes.kind, coverage_classes.dimension, coverage_classes.class, class_number
ORDER BY classes.kind, class_number;

COMMENT ON VIEW coverage_by_kind IS 'Numbers of crashes of each kind in each class of the three dimensions';
COMMENT ON COLUMN coverage_by_kind.kind IS 'Kind of crash';
COMMENT ON COLUMN coverage_by_kind.dimension IS 'collision_type, road_topology or vehicle_trajectory';
COMMENT ON COLUMN coverage_by_kind.class IS 'Class of the dimension';
COMMENT ON COLUMN coverage_by_kind.registered IS 'Crashes of that kind and class, whatever became of them';
COMMENT ON COLUMN coverage_by_kind.verified IS 'Verified crashes of that kind and class';
