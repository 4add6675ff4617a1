-- Which re-runs changed what became of a crash: from verified to rejected, back, or to another reason. Failures say
-- nothing about a crash and are passed over. A result may also change by standing again: an earlier stage runs once more,
-- makes what it made before, and the later results hold without being computed; so the present standing is the last.
CREATE VIEW verdict_changes AS
WITH ended AS (
    SELECT
        key,
        started_at,
        run_id,
        stage_number,
        if(outcome = 'accepted', 'verified', 'rejected') AS result,
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
        crashes.final_state AS result,
        crashes.reason,
        crashes.detail
    FROM crashes
    JOIN (
        SELECT key, max(started_at) AS started_at, arg_max(run_id, started_at) AS run_id
        FROM stage_history
        GROUP BY key
    ) AS latest USING (key)
    WHERE crashes.final_state IN ('verified', 'rejected')
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
COMMENT ON COLUMN verdict_changes.changed_at IS 'When the stage that did began, UTC';
COMMENT ON COLUMN verdict_changes.result_before IS 'verified or rejected, before';
COMMENT ON COLUMN verdict_changes.reason_before IS 'Reason code of the rejection before';
COMMENT ON COLUMN verdict_changes.result_after IS 'verified or rejected, after';
COMMENT ON COLUMN verdict_changes.reason_after IS 'Reason code of the rejection after';
COMMENT ON COLUMN verdict_changes.detail IS 'The sentence behind the rejection after';
