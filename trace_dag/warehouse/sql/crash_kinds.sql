-- The kinds of crash there are, and which of them can be judged.
CREATE TABLE crash_kinds AS
SELECT kind, judged
FROM kind_of_crash;

COMMENT ON TABLE crash_kinds IS 'The kinds of crash';
COMMENT ON COLUMN crash_kinds.kind IS 'Kind of crash';
COMMENT ON COLUMN crash_kinds.judged IS 'Whether such crashes can be judged; others are rejected as not_modelled';
