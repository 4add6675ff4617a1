-- The three dimensions crossed: every combination that occurs.
CREATE VIEW coverage_cross AS
SELECT
    collision_type,
    road_topology,
    vehicle_trajectory,
    count(*) AS registered,
    count(*) FILTER (final_state = 'verified') AS verified
FROM crashes
WHERE collision_type IS NOT NULL
GROUP BY ALL
ORDER BY verified DESC, registered DESC, collision_type, road_topology, vehicle_trajectory;

COMMENT ON VIEW coverage_cross IS 'The three dimensions of coverage crossed: every combination that occurs';
COMMENT ON COLUMN coverage_cross.collision_type IS 'Class of the manner of collision';
COMMENT ON COLUMN coverage_cross.road_topology IS 'Class of the intersection';
COMMENT ON COLUMN coverage_cross.vehicle_trajectory IS 'Class of the crash type';
COMMENT ON COLUMN coverage_cross.registered IS 'Crashes of that combination';
COMMENT ON COLUMN coverage_cross.verified IS 'Verified crashes of that combination';
