-- The measured guarantees of every road map.
CREATE TABLE map_checks AS
SELECT
    key,
    measured.name AS gate,
    measured.value,
    measured.threshold,
    measured.unit,
    measured.passed,
    nullif(measured.detail, '') AS detail
FROM (SELECT key, unnest(gates) AS measured FROM map_report)
ORDER BY key, gate;

COMMENT ON TABLE map_checks IS 'The measured guarantees of every road map';
COMMENT ON COLUMN map_checks.key IS 'Key of the crash';
COMMENT ON COLUMN map_checks.gate IS 'Name of the guarantee';
COMMENT ON COLUMN map_checks.value IS 'What was measured, in the unit given';
COMMENT ON COLUMN map_checks.threshold IS 'What it was compared with';
COMMENT ON COLUMN map_checks.unit IS 'Unit of value and threshold';
COMMENT ON COLUMN map_checks.passed IS 'Whether it holds; null if it was not evaluated';
COMMENT ON COLUMN map_checks.detail IS 'What was found, or why it was not evaluated';
