-- What to run next: pending and failed crashes that would fill a class without a verified crash, those that would fill
-- several first. Crashes whose reports are not at hand yet (CrashAPI) have no class and are not listed, nor are those of
-- kinds that cannot be judged.
CREATE VIEW cohort_gaps AS
WITH open_crashes AS (
    UNPIVOT (
        SELECT key, cohort, final_state, collision_type, road_topology, vehicle_trajectory
        FROM crashes
        LEFT JOIN crash_kinds USING (kind)
        WHERE final_state IN ('pending', 'failed') AND coalesce(judged, TRUE)
    )
    ON collision_type, road_topology, vehicle_trajectory
    INTO NAME dimension VALUE class
)
SELECT
    open_crashes.key,
    open_crashes.cohort,
    open_crashes.final_state,
    count(*) AS classes_filled,
    string_agg(coverage.dimension || ' ' || coverage.class, ', ' ORDER BY coverage.dimension) AS would_fill
FROM open_crashes
JOIN coverage ON coverage.dimension = open_crashes.dimension AND coverage.class = open_crashes.class
WHERE coverage.verified = 0
GROUP BY ALL
ORDER BY classes_filled DESC, open_crashes.key;

COMMENT ON VIEW cohort_gaps IS 'Pending crashes of classes that have no verified crash';
COMMENT ON COLUMN cohort_gaps.key IS 'Key of the crash';
COMMENT ON COLUMN cohort_gaps.cohort IS 'Its cohort';
COMMENT ON COLUMN cohort_gaps.final_state IS 'pending or failed';
COMMENT ON COLUMN cohort_gaps.classes_filled IS 'Uncovered classes it would fill';
COMMENT ON COLUMN cohort_gaps.would_fill IS 'Names of these classes';
