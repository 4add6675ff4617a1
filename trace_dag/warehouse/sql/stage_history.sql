-- Every outcome that is known of a stage and crash, in order: those that a later run has replaced, and the last.
CREATE TABLE stage_history AS
SELECT key, stage, number, outcome, reason, detail, started_at, run_id, fingerprint, standing, stage_number
FROM known_outcome
ORDER BY key, stage_number, number;

COMMENT ON TABLE stage_history IS 'Every known outcome of a stage and crash: the current one, and the latest twenty replaced ones';
COMMENT ON COLUMN stage_history.key IS 'Key of the crash';
COMMENT ON COLUMN stage_history.stage IS 'Stage of the flow';
COMMENT ON COLUMN stage_history.number IS 'Order of the outcomes, from 1';
COMMENT ON COLUMN stage_history.outcome IS 'accepted, rejected or failed';
COMMENT ON COLUMN stage_history.reason IS 'Reason code of a rejection';
COMMENT ON COLUMN stage_history.detail IS 'The sentence behind it';
COMMENT ON COLUMN stage_history.started_at IS 'When the stage began, UTC';
COMMENT ON COLUMN stage_history.run_id IS 'Dagster run that computed it';
COMMENT ON COLUMN stage_history.fingerprint IS 'SHA-256 over code version, settings and inputs';
COMMENT ON COLUMN stage_history.standing IS 'Whether it still counts; not if it was replaced, or an earlier stage ended the crash or was computed again';
COMMENT ON COLUMN stage_history.stage_number IS 'Position of the stage in the flow, from 1';
