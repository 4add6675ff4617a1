-- Every doubt about an accepted crash: each keeps it from being corroborated, whatever supports it.
CREATE TABLE reservations AS
SELECT key, support.detail = '' AS otherwise_corroborated, doubtful.doubt AS doubt, doubtful.detail AS detail
FROM (SELECT key, support, unnest(reservations) AS doubtful FROM verdict)
ORDER BY ALL;

COMMENT ON TABLE reservations IS 'Every doubt about an accepted crash; with one it is not corroborated';
COMMENT ON COLUMN reservations.key IS 'Key of the crash';
COMMENT ON COLUMN reservations.otherwise_corroborated IS 'Whether facts and support would be enough without doubts; null where no support is measured';
COMMENT ON COLUMN reservations.doubt IS 'other_street, event_missed, harmless or ambiguous';
COMMENT ON COLUMN reservations.detail IS 'What was found, in words';
