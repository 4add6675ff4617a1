-- What each agent made of the crashes of each kind, and of each class of the three coverage dimensions.
CREATE VIEW leaderboard_by_class AS
WITH classes AS (
    UNPIVOT (SELECT key, kind, collision_type, road_topology, vehicle_trajectory FROM crashes)
    ON kind, collision_type, road_topology, vehicle_trajectory
    INTO NAME dimension VALUE class
)
SELECT
    agent,
    dimension,
    class,
    count(*) AS runs,
    count(*) FILTER (outcome = 'avoided') AS avoided,
    count(*) FILTER (outcome = 'softened') AS softened,
    count(*) FILTER (outcome = 'same') AS same,
    count(*) FILTER (outcome = 'worse') AS worse,
    count(*) FILTER (outcome = 'faulty') AS faulty
FROM evaluations
JOIN classes USING (key)
WHERE case_id = key AND role IS DISTINCT FROM 'departing'
GROUP BY agent, dimension, class
ORDER BY agent, dimension, class;

COMMENT ON VIEW leaderboard_by_class IS 'What each agent made of the verified crashes of each kind and class';
COMMENT ON COLUMN leaderboard_by_class.agent IS 'Name of the agent, and of conditions other than the usual';
COMMENT ON COLUMN leaderboard_by_class.dimension IS 'kind, collision_type, road_topology or vehicle_trajectory';
COMMENT ON COLUMN leaderboard_by_class.class IS 'Class of the dimension';
COMMENT ON COLUMN leaderboard_by_class.runs IS 'Evaluations: crashes times places it took';
COMMENT ON COLUMN leaderboard_by_class.avoided IS 'Runs in which nobody touched anybody';
COMMENT ON COLUMN leaderboard_by_class.softened IS 'Runs with a lower delta-v than the crash';
COMMENT ON COLUMN leaderboard_by_class.same IS 'Runs with the crash''s delta-v, within a tenth or 0.5 m/s';
COMMENT ON COLUMN leaderboard_by_class.worse IS 'Runs with a higher delta-v than the crash';
COMMENT ON COLUMN leaderboard_by_class.faulty IS 'Runs in which the agent broke its side of the interface';
