-- Earlier outcomes of the same stage and crash, replaced since by a later run.
CREATE TABLE stage_history AS
SELECT key, stage, attempt, outcome, reason, started_at, run_id, fingerprint
FROM earlier_outcome
ORDER BY key, stage, attempt;

COMMENT ON TABLE stage_history IS 'Earlier outcomes of a stage and crash, replaced since; the latest twenty are kept';
COMMENT ON COLUMN stage_history.key IS 'Key of the crash';
COMMENT ON COLUMN stage_history.stage IS 'Stage of the flow';
COMMENT ON COLUMN stage_history.attempt IS 'Order of the outcomes, from 1';
COMMENT ON COLUMN stage_history.outcome IS 'accepted, rejected or failed';
COMMENT ON COLUMN stage_history.reason IS 'Reason code of a rejection';
COMMENT ON COLUMN stage_history.started_at IS 'When the stage began, UTC';
COMMENT ON COLUMN stage_history.run_id IS 'Dagster run that computed it';
COMMENT ON COLUMN stage_history.fingerprint IS 'SHA-256 over code version, settings and inputs';
