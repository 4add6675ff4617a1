-- The classes of the three dimensions, with the counts of the 52 published cases.
CREATE TABLE coverage_classes AS
SELECT *
FROM (
    VALUES
        (1, 'collision_type', 'front_to_rear', 3),
        (2, 'collision_type', 'front_to_front', 23),
        (3, 'collision_type', 'angle', 19),
        (4, 'collision_type', 'sideswipe_same_direction', 0),
        (5, 'collision_type', 'sideswipe_opposite_direction', 2),
        (6, 'collision_type', 'rear_to_side', 0),
        (7, 'collision_type', 'rear_to_rear', 0),
        (8, 'collision_type', 'others', 5),
        (9, 'road_topology', 'not_an_intersection', 36),
        (10, 'road_topology', 'four_way', 8),
        (11, 'road_topology', 't', 8),
        (12, 'road_topology', 'y', 0),
        (13, 'road_topology', 'roundabout', 0),
        (14, 'road_topology', 'five_point_or_more', 0),
        (15, 'road_topology', 'l', 0),
        (16, 'road_topology', 'others', 0),
        (17, 'vehicle_trajectory', 'same_direction', 4),
        (18, 'vehicle_trajectory', 'opposite_direction', 27),
        (19, 'vehicle_trajectory', 'turning', 9),
        (20, 'vehicle_trajectory', 'intersecting', 7),
        (21, 'vehicle_trajectory', 'others', 5)
) AS classes (class_number, dimension, class, published);

COMMENT ON TABLE coverage_classes IS 'The classes of the three dimensions of coverage';
COMMENT ON COLUMN coverage_classes.class_number IS 'Order of the classes';
COMMENT ON COLUMN coverage_classes.dimension IS 'collision_type, road_topology or vehicle_trajectory';
COMMENT ON COLUMN coverage_classes.class IS 'Class of the dimension';
COMMENT ON COLUMN coverage_classes.published IS 'Cases of that class in the published benchmark of 52';
