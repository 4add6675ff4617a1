-- Agents side by side, over all verified crashes they drove in (not their variations), best first: those that drove in
-- every case that any of them did, then those that did not, whose figures are of other cases.
CREATE VIEW leaderboard AS
WITH asked AS (
    SELECT count(DISTINCT (key, vehicle_number)) AS cases, count(DISTINCT key) AS crashes_asked
    FROM evaluations
    WHERE case_id = key AND role IS DISTINCT FROM 'departing'
)

SELECT
    agent,
    count(*) AS runs,
    asked.cases,
    count(DISTINCT key) AS crashes,
    asked.crashes_asked,
    any_value(traffic) AS traffic,
    CASE WHEN count(DISTINCT coalesce(split, 'all')) = 1 THEN any_value(split) END AS split,
    bool_or(coalesce(handed_in, FALSE)) AS handed_in,
    count(*) FILTER (outcome = 'conflict_avoided') AS conflict_avoided,
    count(*) FILTER (outcome = 'collision_avoided') AS collision_avoided,
    count(*) FILTER (outcome = 'did_not_arrive') AS did_not_arrive,
    count(*) FILTER (outcome = 'rules_broken') AS rules_broken,
    count(*) FILTER (outcome = 'mitigated') AS mitigated,
    count(*) FILTER (outcome = 'unchanged') AS unchanged,
    count(*) FILTER (outcome = 'worse') AS worse,
    count(*) FILTER (outcome = 'faulty') AS faulty,
    count(*) FILTER (off_road_s > 0.5) AS off_road,
    count(*) FILTER (wrong_way_s > 0.5) AS wrong_way,
    count(*) FILTER (NOT collided AND NOT finished) AS unfinished,
    avg(recorded_serious_injury_risk - serious_injury_risk) AS risk_saved,
    sum(recorded_delta_v_mps - delta_v_mps) / sum(recorded_delta_v_mps) AS delta_v_saved_rel,
    median(max_deceleration_mps2) AS max_deceleration_median_mps2,
    median(max_jerk_mps3) AS max_jerk_median_mps3,
    median(min_ttc_s) AS min_ttc_median_s,
    median(post_encroachment_time_s) AS post_encroachment_median_s,
    median(required_deceleration_mps2) AS required_deceleration_median_mps2
FROM evaluations, asked
WHERE case_id = key AND role IS DISTINCT FROM 'departing'
GROUP BY agent, asked.cases, asked.crashes_asked
ORDER BY runs < asked.cases, (conflict_avoided + collision_avoided) / runs DESC, delta_v_saved_rel DESC, agent;

COMMENT ON VIEW leaderboard IS 'Comparison of agents over the verified crashes in which they drove';
COMMENT ON COLUMN leaderboard.agent IS 'Name of the agent, and of conditions other than the usual';
COMMENT ON COLUMN leaderboard.runs IS 'Evaluations: crashes times places it took';
COMMENT ON COLUMN leaderboard.cases IS 'Pairs of crash and place in which any agent drove; agents with fewer runs are listed below the others';
COMMENT ON COLUMN leaderboard.crashes IS 'Crashes it drove in';
COMMENT ON COLUMN leaderboard.crashes_asked IS 'Crashes that any agent drove in';
COMMENT ON COLUMN leaderboard.traffic IS 'Motion of the others: recorded, reactive or persistent';
COMMENT ON COLUMN leaderboard.split IS 'The part of the benchmark it was evaluated on; NULL where on no part as a whole';
COMMENT ON COLUMN leaderboard.handed_in IS 'Whether its runs were handed in as a file';
COMMENT ON COLUMN leaderboard.conflict_avoided IS 'Runs in which it passed, with 1.5 s or more to every contact';
COMMENT ON COLUMN leaderboard.collision_avoided IS 'Runs in which it passed without a contact, but with less than 1.5 s to one';
COMMENT ON COLUMN leaderboard.did_not_arrive IS 'Runs without a contact in which it never passed the conflict';
COMMENT ON COLUMN leaderboard.rules_broken IS 'Runs in which it passed, but off the road or faster than traffic';
COMMENT ON COLUMN leaderboard.mitigated IS 'Runs with a risk of serious injury lower by more than a tenth';
COMMENT ON COLUMN leaderboard.unchanged IS 'Runs with the crash''s risk of serious injury, within a tenth';
COMMENT ON COLUMN leaderboard.worse IS 'Runs with a risk higher by more than a tenth';
COMMENT ON COLUMN leaderboard.faulty IS 'Runs in which the agent violated the interface';
COMMENT ON COLUMN leaderboard.off_road IS 'Runs with more than half a second off the road';
COMMENT ON COLUMN leaderboard.wrong_way IS 'Runs with more than half a second in lanes of the other direction';
COMMENT ON COLUMN leaderboard.unfinished IS 'Runs without a contact in which it did not reach its goal in twice the recorded time';
COMMENT ON COLUMN leaderboard.risk_saved IS 'Risk of serious injury of the crashes less that of its runs, mean of all runs but faulty ones';
COMMENT ON COLUMN leaderboard.delta_v_saved_rel IS 'Share of the crashes'' delta-v that it saved, over all runs but faulty ones';
COMMENT ON COLUMN leaderboard.max_deceleration_median_mps2 IS 'Hardest braking of a run, median, m/s2';
COMMENT ON COLUMN leaderboard.max_jerk_median_mps3 IS 'Sharpest change of acceleration of a run, median, m/s3';
COMMENT ON COLUMN leaderboard.min_ttc_median_s IS 'Least time to collision of a run, 0 for a contact, median, s';
COMMENT ON COLUMN leaderboard.post_encroachment_median_s IS 'Post-encroachment time of a run, 0 for a contact, median, s';
COMMENT ON COLUMN leaderboard.required_deceleration_median_mps2 IS 'Most deceleration needed in a run without a contact, median, m/s2';
