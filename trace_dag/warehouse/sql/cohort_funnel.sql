-- The funnel of each cohort by itself.
CREATE VIEW cohort_funnel AS
WITH passed AS (
    SELECT
        crashes.key,
        crashes.cohort,
        coalesce(max(stage_number) FILTER (outcome = 'accepted'), 0)
            + bool_or(final_state = 'verified')::INTEGER AS stages
    FROM crashes
    LEFT JOIN stage_outcomes USING (key)
    GROUP BY crashes.key, crashes.cohort
)
SELECT cohort, step, count(*) FILTER (stages >= needed) AS crashes
FROM passed
CROSS JOIN (
    VALUES
        (1, 'registered', 0), (2, 'complete', 2), (3, 'mapped', 4), (4, 'estimated', 5), (5, 'collided', 6),
        (6, 'accepted', 7), (7, 'verified', 8)
) AS steps (step_number, step, needed)
GROUP BY cohort, step_number, step
ORDER BY cohort, step_number;

COMMENT ON VIEW cohort_funnel IS 'Numbers of crashes of each cohort that passed each step';
COMMENT ON COLUMN cohort_funnel.cohort IS 'Cohort';
COMMENT ON COLUMN cohort_funnel.step IS 'Step of the funnel';
COMMENT ON COLUMN cohort_funnel.crashes IS 'Crashes of the cohort that passed it';
