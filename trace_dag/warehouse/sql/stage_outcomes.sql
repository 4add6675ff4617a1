-- What every stage said about every crash it examined; stages a crash did not reach have no row.
CREATE TABLE stage_outcomes AS
SELECT
    key, stage, outcome, reason, detail, duration_s, stage_number, published_category, measured, threshold,
    started_at, run_id, attempts, artefacts, artefact_bytes, fingerprint, code_version, settings, transient, error
FROM outcome
ORDER BY key, stage_number;

COMMENT ON TABLE stage_outcomes IS 'Outcome of every stage for every crash';
COMMENT ON COLUMN stage_outcomes.key IS 'Key of the crash';
COMMENT ON COLUMN stage_outcomes.stage IS 'Stage of the flow';
COMMENT ON COLUMN stage_outcomes.outcome IS 'accepted, rejected or failed';
COMMENT ON COLUMN stage_outcomes.reason IS 'Reason code of a rejection';
COMMENT ON COLUMN stage_outcomes.detail IS 'The sentence behind it, with what was measured';
COMMENT ON COLUMN stage_outcomes.duration_s IS 'Time the stage took for this crash, s';
COMMENT ON COLUMN stage_outcomes.stage_number IS 'Position of the stage in the flow, from 1';
COMMENT ON COLUMN stage_outcomes.published_category IS 'Category of the published paper the reason is counted under';
COMMENT ON COLUMN stage_outcomes.measured IS 'The number behind the rejection, in the unit its sentence states';
COMMENT ON COLUMN stage_outcomes.threshold IS 'The number it was compared with';
COMMENT ON COLUMN stage_outcomes.started_at IS 'When the stage began, UTC';
COMMENT ON COLUMN stage_outcomes.run_id IS 'Dagster run that computed it';
COMMENT ON COLUMN stage_outcomes.attempts IS 'Attempts it took, transient failures repeated';
COMMENT ON COLUMN stage_outcomes.artefacts IS 'Files it left';
COMMENT ON COLUMN stage_outcomes.artefact_bytes IS 'Their size together, bytes';
COMMENT ON COLUMN stage_outcomes.fingerprint IS 'SHA-256 over code version, settings and inputs';
COMMENT ON COLUMN stage_outcomes.code_version IS 'Version of the code that computed it';
COMMENT ON COLUMN stage_outcomes.settings IS 'Settings of the stage it was computed with, JSON';
COMMENT ON COLUMN stage_outcomes.transient IS 'The failure may pass by itself';
COMMENT ON COLUMN stage_outcomes.error IS 'Traceback of a failure';
