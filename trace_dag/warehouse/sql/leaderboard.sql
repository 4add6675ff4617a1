-- Agents side by side, over all verified crashes they drove in (not their variations), best first: those that drove in
-- every case that any of them did, then those that did not, whose figures are of other cases.
CREATE VIEW leaderboard AS
WITH asked AS (SELECT count(DISTINCT (key, vehicle_number)) AS cases FROM evaluations WHERE case_id = key AND role IS DISTINCT FROM 'departing')
SELECT
    agent,
    count(*) AS runs,
    asked.cases,
    count(*) FILTER (outcome = 'avoided') AS avoided,
    count(*) FILTER (outcome = 'softened') AS softened,
    count(*) FILTER (outcome = 'same') AS same,
    count(*) FILTER (outcome = 'worse') AS worse,
    count(*) FILTER (outcome = 'faulty') AS faulty,
    count(*) FILTER (off_road_s > 0.5) AS off_road,
    count(*) FILTER (wrong_way_s > 0.5) AS wrong_way,
    sum(recorded_delta_v_mps - delta_v_mps) / sum(recorded_delta_v_mps) AS delta_v_saved_rel,
    median(max_deceleration_mps2) AS max_deceleration_median_mps2,
    median(max_jerk_mps3) AS max_jerk_median_mps3
FROM evaluations, asked
WHERE case_id = key AND role IS DISTINCT FROM 'departing'
GROUP BY agent, asked.cases
ORDER BY runs < asked.cases, avoided / runs DESC, delta_v_saved_rel DESC, agent;

COMMENT ON VIEW leaderboard IS 'Agents side by side, over the verified crashes they drove in';
COMMENT ON COLUMN leaderboard.agent IS 'Name of the agent, and of conditions other than the usual';
COMMENT ON COLUMN leaderboard.runs IS 'Evaluations: crashes times places it took';
COMMENT ON COLUMN leaderboard.cases IS 'Crashes times places that any agent took: agents with fewer runs stand below the others';
COMMENT ON COLUMN leaderboard.avoided IS 'Runs in which nobody touched anybody';
COMMENT ON COLUMN leaderboard.softened IS 'Runs with a lower delta-v than the crash';
COMMENT ON COLUMN leaderboard.same IS 'Runs with the crash''s delta-v, within a tenth or 0.5 m/s';
COMMENT ON COLUMN leaderboard.worse IS 'Runs with a higher delta-v than the crash';
COMMENT ON COLUMN leaderboard.faulty IS 'Runs in which the agent broke its side of the interface';
COMMENT ON COLUMN leaderboard.off_road IS 'Runs with more than half a second off the road';
COMMENT ON COLUMN leaderboard.wrong_way IS 'Runs with more than half a second in lanes of the other direction';
COMMENT ON COLUMN leaderboard.delta_v_saved_rel IS 'Share of the crashes'' delta-v that it saved, over all runs but faulty ones';
COMMENT ON COLUMN leaderboard.max_deceleration_median_mps2 IS 'Hardest braking of a run, median, m/s2';
COMMENT ON COLUMN leaderboard.max_jerk_median_mps3 IS 'Sharpest change of acceleration of a run, median, m/s3';
