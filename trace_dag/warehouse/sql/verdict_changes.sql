-- Re-runs that changed the outcome of a crash: from accepted to rejected, back, or to another reason. Failures are passed
-- over. A result may also change without being computed: an earlier stage runs once more and gives its old output, so that
-- the later results are valid again. So the present state is the last row of each crash.
CREATE VIEW verdict_changes AS
WITH ended AS (
    SELECT
        key,
        started_at,
        run_id,
        stage_number,
        outcome AS result,
        reason,
        detail
    FROM stage_history
    WHERE outcome = 'rejected' OR (outcome = 'accepted' AND stage = 'verdict')
),

present AS (
    SELECT
        crashes.key,
        latest.started_at,
        latest.run_id,
        99 AS stage_number,
        if(crashes.final_state = 'rejected', 'rejected', 'accepted') AS result,
        crashes.reason,
        crashes.detail
    FROM crashes
    JOIN (
        SELECT key, max(started_at) AS started_at, arg_max(run_id, started_at) AS run_id
        FROM stage_history
        GROUP BY key
    ) AS latest USING (key)
    WHERE crashes.final_state IN ('verified', 'first_event_only', 'rejected')
),

in_order AS (
    SELECT
        *,
        lag(result) OVER earlier AS result_before,
        lag(reason) OVER earlier AS reason_before
    FROM (FROM ended UNION ALL FROM present)
    WINDOW earlier AS (PARTITION BY key ORDER BY started_at, stage_number)
)

SELECT
    key,
    run_id,
    started_at AS changed_at,
    result_before,
    reason_before,
    result AS result_after,
    reason AS reason_after,
    detail
FROM in_order
WHERE result_before IS NOT NULL AND (result, reason) IS DISTINCT FROM (result_before, reason_before)
ORDER BY changed_at, key;

COMMENT ON VIEW verdict_changes IS 'Changes of a crash''s outcome by re-runs';
COMMENT ON COLUMN verdict_changes.key IS 'Key of the crash';
COMMENT ON COLUMN verdict_changes.run_id IS 'Dagster run that changed it';
COMMENT ON COLUMN verdict_changes.changed_at IS 'Time at which the stage that changed it began, UTC';
COMMENT ON COLUMN verdict_changes.result_before IS 'accepted (verified or first_event_only) or rejected, before';
COMMENT ON COLUMN verdict_changes.reason_before IS 'Reason code of the rejection before';
COMMENT ON COLUMN verdict_changes.result_after IS 'accepted (verified or first_event_only) or rejected, after';
COMMENT ON COLUMN verdict_changes.reason_after IS 'Reason code of the rejection after';
COMMENT ON COLUMN verdict_changes.detail IS 'Sentence of the rejection after';
