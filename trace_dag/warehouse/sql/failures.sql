-- What broke, by crash: the message and, for whoever mends it, the traceback.
CREATE TABLE failures AS
SELECT
    crashes.key,
    crashes.cohort,
    crashes.final_state,
    failed_attempt.stage,
    failed_attempt.detail AS message,
    failed_attempt.transient,
    failed_attempt.attempts,
    failed_attempt.started_at,
    failed_attempt.run_id,
    failed_attempt.error
FROM crashes
JOIN failed_attempt USING (key)
ORDER BY crashes.key;

COMMENT ON TABLE failures IS 'Failed and outdated crashes; trace-dag rerun --failed runs them again';
COMMENT ON COLUMN failures.key IS 'Key of the crash';
COMMENT ON COLUMN failures.cohort IS 'Its cohort';
COMMENT ON COLUMN failures.final_state IS 'State of the crash: failed, or its state before the attempt';
COMMENT ON COLUMN failures.stage IS 'Stage that broke';
COMMENT ON COLUMN failures.message IS 'What happened';
COMMENT ON COLUMN failures.transient IS 'Whether it may pass by itself';
COMMENT ON COLUMN failures.attempts IS 'Attempts that were made';
COMMENT ON COLUMN failures.started_at IS 'When the stage began, UTC';
COMMENT ON COLUMN failures.run_id IS 'Dagster run it broke in';
COMMENT ON COLUMN failures.error IS 'Traceback';
