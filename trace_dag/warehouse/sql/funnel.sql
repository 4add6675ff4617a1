-- How many crashes got past each step, beside the 100 reports, 65 maps and 52 accepted reconstructions of the published
-- study (TRACE, FSE Companion '26).
CREATE VIEW funnel AS
WITH passed AS (
    SELECT
        crashes.key,
        coalesce(max(stage_number) FILTER (outcome = 'accepted'), 0)
            + bool_or(final_state = 'verified')::INTEGER AS stages
    FROM crashes
    LEFT JOIN stage_outcomes USING (key)
    GROUP BY crashes.key
)
SELECT step, count(*) FILTER (stages >= needed) AS crashes, any_value(published) AS published
FROM passed
RIGHT JOIN (
    VALUES
        (1, 'registered', 0, 100),
        (2, 'complete', 2, NULL),
        (3, 'mapped', 4, 65),
        (4, 'estimated', 5, NULL),
        (5, 'collided', 6, NULL),
        (6, 'accepted', 7, 52),
        (7, 'verified', 8, NULL)
) AS steps (step_number, step, needed, published) ON true
GROUP BY step_number, step
ORDER BY step_number;

COMMENT ON VIEW funnel IS 'Numbers of crashes that passed each step, beside the counts of the published study (TRACE, FSE Companion ''26)';
COMMENT ON COLUMN funnel.step IS 'Step of the funnel';
COMMENT ON COLUMN funnel.crashes IS 'Crashes that passed it';
COMMENT ON COLUMN funnel.published IS 'Crashes of the published study, which has only two vehicles; null if it has no count';
