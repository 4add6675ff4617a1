-- Every simulated hypothesis: why it ended and after how long.
CREATE TABLE simulations AS
SELECT
    key,
    hypothesis,
    backend,
    backend_version,
    step_s,
    duration_s,
    termination,
    reason,
    len(contacts) AS contacts
FROM simulation
ORDER BY key, hypothesis;

COMMENT ON TABLE simulations IS 'Every simulated hypothesis';
COMMENT ON COLUMN simulations.key IS 'Key of the crash';
COMMENT ON COLUMN simulations.hypothesis IS 'Index of the hypothesis in the estimate';
COMMENT ON COLUMN simulations.backend IS 'Simulator';
COMMENT ON COLUMN simulations.backend_version IS 'Its version';
COMMENT ON COLUMN simulations.step_s IS 'Integration step, s';
COMMENT ON COLUMN simulations.duration_s IS 'Simulated time, s';
COMMENT ON COLUMN simulations.termination IS 'Why it ended';
COMMENT ON COLUMN simulations.reason IS 'The same in words';
COMMENT ON COLUMN simulations.contacts IS 'Contacts between bodies';
