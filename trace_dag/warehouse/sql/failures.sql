-- What broke, by crash: the message and, for whoever mends it, the traceback.
CREATE VIEW failures AS
SELECT
    crashes.key,
    crashes.cohort,
    stage_outcomes.stage,
    stage_outcomes.detail AS message,
    stage_outcomes.transient,
    stage_outcomes.attempts,
    stage_outcomes.started_at,
    stage_outcomes.run_id,
    stage_outcomes.error
FROM crashes
JOIN stage_outcomes USING (key)
WHERE stage_outcomes.outcome = 'failed'
ORDER BY crashes.key;

COMMENT ON VIEW failures IS 'The crashes that stand failed; trace-dag rerun --failed runs them again';
COMMENT ON COLUMN failures.key IS 'Key of the crash';
COMMENT ON COLUMN failures.cohort IS 'Its cohort';
COMMENT ON COLUMN failures.stage IS 'Stage that broke';
COMMENT ON COLUMN failures.message IS 'What happened';
COMMENT ON COLUMN failures.transient IS 'Whether it may pass by itself';
COMMENT ON COLUMN failures.attempts IS 'Attempts that were made';
COMMENT ON COLUMN failures.started_at IS 'When the stage began, UTC';
COMMENT ON COLUMN failures.run_id IS 'Dagster run it broke in';
COMMENT ON COLUMN failures.error IS 'Traceback';
