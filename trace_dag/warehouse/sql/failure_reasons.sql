-- Why crashes were rejected, by stage and reason, beside the published paper's categories.
CREATE VIEW failure_reasons AS
SELECT stage, reason, any_value(published_category) AS published_category, count(*) AS crashes
FROM stage_outcomes
WHERE outcome = 'rejected'
GROUP BY stage, stage_number, reason
ORDER BY stage_number, crashes DESC, reason;

COMMENT ON VIEW failure_reasons IS 'Reasons for rejections, with counts';
COMMENT ON COLUMN failure_reasons.stage IS 'Stage that rejected';
COMMENT ON COLUMN failure_reasons.reason IS 'Reason code';
COMMENT ON COLUMN failure_reasons.published_category IS 'Category of the published paper it is counted under';
COMMENT ON COLUMN failure_reasons.crashes IS 'Crashes rejected for it';
