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
    count(*) FILTER (outcome = 'conflict_avoided') AS conflict_avoided,
    count(*) FILTER (outcome = 'collision_avoided') AS collision_avoided,
    count(*) FILTER (outcome = 'did_not_arrive') AS did_not_arrive,
    count(*) FILTER (outcome = 'rules_broken') AS rules_broken,
    count(*) FILTER (outcome = 'mitigated') AS mitigated,
    count(*) FILTER (outcome = 'unchanged') AS unchanged,
    count(*) FILTER (outcome = 'worse') AS worse,
    count(*) FILTER (outcome = 'faulty') AS faulty
FROM evaluations
JOIN classes USING (key)
WHERE case_id = key AND role IS DISTINCT FROM 'departing'
GROUP BY agent, dimension, class
ORDER BY agent, dimension, class;

COMMENT ON VIEW leaderboard_by_class IS 'Results of each agent in verified crashes, by kind and class';
COMMENT ON COLUMN leaderboard_by_class.agent IS 'Name of the agent, and of conditions other than the usual';
COMMENT ON COLUMN leaderboard_by_class.dimension IS 'kind, collision_type, road_topology or vehicle_trajectory';
COMMENT ON COLUMN leaderboard_by_class.class IS 'Class of the dimension';
COMMENT ON COLUMN leaderboard_by_class.runs IS 'Evaluations: crashes times places it took';
COMMENT ON COLUMN leaderboard_by_class.conflict_avoided IS 'Runs in which it passed, with 1.5 s or more to every contact';
COMMENT ON COLUMN leaderboard_by_class.collision_avoided IS 'Runs in which it passed without a contact, but with less than 1.5 s to one';
COMMENT ON COLUMN leaderboard_by_class.did_not_arrive IS 'Runs without a contact in which it never passed the conflict';
COMMENT ON COLUMN leaderboard_by_class.rules_broken IS 'Runs in which it passed, but off the road or faster than traffic';
COMMENT ON COLUMN leaderboard_by_class.mitigated IS 'Runs with a risk of serious injury lower by more than a tenth';
COMMENT ON COLUMN leaderboard_by_class.unchanged IS 'Runs with the crash''s risk of serious injury, within a tenth';
COMMENT ON COLUMN leaderboard_by_class.worse IS 'Runs with a risk higher by more than a tenth';
COMMENT ON COLUMN leaderboard_by_class.faulty IS 'Runs in which the agent violated the interface';
