-- What each run did: crashes, stages, computing time, the slowest crash, retries and cost.
CREATE VIEW run_summary AS
SELECT
    run_id,
    min(started_at) AS began_at,
    count(DISTINCT stage_outcomes.key) AS crashes,
    count(*) AS stages,
    count(*) FILTER (outcome = 'rejected') AS rejected,
    count(*) FILTER (outcome = 'failed') AS failed,
    sum(stage_outcomes.duration_s) AS computing_s,
    arg_max(stage_outcomes.key, stage_outcomes.duration_s) AS slowest_crash,
    max(stage_outcomes.duration_s) AS slowest_stage_s,
    sum(stage_outcomes.attempts - 1) AS retries,
    sum(estimates.cost_usd) FILTER (stage = 'state_estimate') AS cost_usd
FROM stage_outcomes
LEFT JOIN estimates ON estimates.key = stage_outcomes.key
GROUP BY run_id
ORDER BY began_at;

COMMENT ON VIEW run_summary IS 'Work of each run, as far as its results are current';
COMMENT ON COLUMN run_summary.run_id IS 'Dagster run';
COMMENT ON COLUMN run_summary.began_at IS 'Its first stage, UTC';
COMMENT ON COLUMN run_summary.crashes IS 'Crashes it computed something for';
COMMENT ON COLUMN run_summary.stages IS 'Stages it computed';
COMMENT ON COLUMN run_summary.rejected IS 'Rejections among them';
COMMENT ON COLUMN run_summary.failed IS 'Failures among them';
COMMENT ON COLUMN run_summary.computing_s IS 'Time in stages, summed over workers, s';
COMMENT ON COLUMN run_summary.slowest_crash IS 'Crash with the longest stage';
COMMENT ON COLUMN run_summary.slowest_stage_s IS 'That stage''s time, s';
COMMENT ON COLUMN run_summary.retries IS 'Stages tried again after transient failures';
COMMENT ON COLUMN run_summary.cost_usd IS 'Cost of language models, US dollars';
