-- What several estimators made of the same crashes: simulated and judged alike, and measured against the truth if known.
CREATE TABLE estimator_comparison AS
SELECT *
FROM read_json(
    getvariable('estimator_files'),
    columns = {
        'cohort': 'VARCHAR',
        'key': 'VARCHAR',
        'estimator': 'VARCHAR',
        'outcome': 'VARCHAR',
        'detail': 'VARCHAR',
        'hypothesis': 'VARCHAR',
        'hypotheses': 'INTEGER',
        'ambiguity': 'DOUBLE',
        'checks_failed': 'INTEGER',
        'approach_agrees': 'BOOLEAN',
        'lane_agrees': 'BOOLEAN',
        'impact_apart_m': 'DOUBLE',
        'accepted': 'BOOLEAN',
        'reason': 'VARCHAR',
        'model': 'VARCHAR',
        'prompt_version': 'VARCHAR',
        'attempts': 'INTEGER',
        'prompt_tokens': 'BIGINT',
        'completion_tokens': 'BIGINT',
        'cost_usd': 'DOUBLE',
        'latency_s': 'DOUBLE',
        'approach_correct': 'BOOLEAN',
        'lane_correct': 'BOOLEAN',
        'impact_point_error_m': 'DOUBLE',
        'heading_error_deg': 'DOUBLE',
        'initial_position_error_m': 'DOUBLE'
    }
)
ORDER BY cohort, key, estimator;

COMMENT ON TABLE estimator_comparison IS 'Estimators compared on the same crashes';
COMMENT ON COLUMN estimator_comparison.cohort IS 'Cohort compared on';
COMMENT ON COLUMN estimator_comparison.key IS 'Key of the crash';
COMMENT ON COLUMN estimator_comparison.estimator IS 'Estimator as named in the comparison: analytic, llm, llm:PROMPT, llm@MODEL';
COMMENT ON COLUMN estimator_comparison.outcome IS 'estimated (by itself), fallback (the analytic estimator in its place), rejected or failed';
COMMENT ON COLUMN estimator_comparison.detail IS 'Why there is no estimate of its own';
COMMENT ON COLUMN estimator_comparison.hypothesis IS 'Best hypothesis';
COMMENT ON COLUMN estimator_comparison.hypotheses IS 'Hypotheses kept';
COMMENT ON COLUMN estimator_comparison.ambiguity IS 'Posterior share of all but the best, 0 to 1';
COMMENT ON COLUMN estimator_comparison.checks_failed IS 'Checks the best hypothesis fails';
COMMENT ON COLUMN estimator_comparison.approach_agrees IS 'Both vehicles start on the same road and direction as with the estimator named first';
COMMENT ON COLUMN estimator_comparison.lane_agrees IS 'In the same lane too';
COMMENT ON COLUMN estimator_comparison.impact_apart_m IS 'Impact point to that of the estimator named first, m';
COMMENT ON COLUMN estimator_comparison.accepted IS 'Whether the verdict accepts the simulated estimate';
COMMENT ON COLUMN estimator_comparison.reason IS 'Why not';
COMMENT ON COLUMN estimator_comparison.model IS 'Language model';
COMMENT ON COLUMN estimator_comparison.prompt_version IS 'Version of its prompt';
COMMENT ON COLUMN estimator_comparison.attempts IS 'Answers of the model; 1 for an estimator that asks none';
COMMENT ON COLUMN estimator_comparison.prompt_tokens IS 'Tokens asked with';
COMMENT ON COLUMN estimator_comparison.completion_tokens IS 'Tokens answered with';
COMMENT ON COLUMN estimator_comparison.cost_usd IS 'Cost when the answers were given, US dollars';
COMMENT ON COLUMN estimator_comparison.latency_s IS 'Time the answers took, s';
COMMENT ON COLUMN estimator_comparison.approach_correct IS 'Whether both approaches are the true ones; null without a known truth';
COMMENT ON COLUMN estimator_comparison.lane_correct IS 'Whether both lanes are';
COMMENT ON COLUMN estimator_comparison.impact_point_error_m IS 'Impact point to the true one, m';
COMMENT ON COLUMN estimator_comparison.heading_error_deg IS 'Heading at the impact against the true one, the worse vehicle, degrees';
COMMENT ON COLUMN estimator_comparison.initial_position_error_m IS 'Initial position against the true one, the worse vehicle, where both speeds are reported, m';
