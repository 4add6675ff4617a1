-- Every state estimate: who made it, from how many hypotheses, at what cost.
CREATE TABLE estimates AS
SELECT
    key,
    run.estimator,
    coalesce(run.fallback_from, run.estimator) AS asked_estimator,
    nullif(run.fallback_reason, '') AS fallback_reason,
    run.version,
    run.model,
    run.prompt_version,
    run.attempts,
    run.prompt_tokens,
    run.completion_tokens,
    run.cost_usd,
    run.latency_s,
    len(hypotheses) AS hypotheses,
    hypotheses[1].name AS best,
    hypotheses[1].score AS best_score,
    hypotheses[1].impact_time_s AS impact_time_s,
    ambiguity
FROM estimate
ORDER BY key;

COMMENT ON TABLE estimates IS 'Every state estimate: estimator, number of hypotheses and cost';
COMMENT ON COLUMN estimates.key IS 'Key of the crash';
COMMENT ON COLUMN estimates.estimator IS 'Estimator: analytic or llm';
COMMENT ON COLUMN estimates.asked_estimator IS 'Estimator that was asked; it differs from estimator if that one replaced it';
COMMENT ON COLUMN estimates.fallback_reason IS 'Why the asked estimator made none; null if it did';
COMMENT ON COLUMN estimates.version IS 'Version of the estimator';
COMMENT ON COLUMN estimates.model IS 'Language model, if one was asked';
COMMENT ON COLUMN estimates.prompt_version IS 'Name of the prompt';
COMMENT ON COLUMN estimates.attempts IS 'Answers it took';
COMMENT ON COLUMN estimates.prompt_tokens IS 'Tokens asked';
COMMENT ON COLUMN estimates.completion_tokens IS 'Tokens answered';
COMMENT ON COLUMN estimates.cost_usd IS 'Cost, US dollars';
COMMENT ON COLUMN estimates.latency_s IS 'Time spent waiting for answers, s';
COMMENT ON COLUMN estimates.hypotheses IS 'Hypotheses kept, best first';
COMMENT ON COLUMN estimates.best IS 'Name of the best one';
COMMENT ON COLUMN estimates.best_score IS 'Its log-likelihood';
COMMENT ON COLUMN estimates.impact_time_s IS 'Planned time of the first contact, s from the start';
COMMENT ON COLUMN estimates.ambiguity IS 'Posterior share of all other hypotheses, 0 to 1';
