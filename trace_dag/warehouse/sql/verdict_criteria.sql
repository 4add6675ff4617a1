-- Every criterion of every verdict, those that are only reported too.
CREATE TABLE verdict_criteria AS
SELECT
    key,
    label <> 'rejected' AS accepted,
    label,
    grade,
    support.total AS support,
    support.independent_facts AS independent_facts,
    nullif(support.detail, '') AS support_detail,
    nullif(alternatives, '') AS alternatives,
    nullif(direction_open, []) AS direction_open,
    hypothesis,
    rule_set,
    measured.name AS criterion,
    measured.vehicle_number AS vehicle_number,
    measured.event_number AS event_number,
    measured.value,
    measured.threshold,
    nullif(measured.unit, '') AS unit,
    measured.passed,
    measured.reason,
    nullif(measured.detail, '') AS detail
FROM (
    SELECT
        key, label, grade, support, alternatives, direction_open, hypothesis, rule_set, unnest(criteria) AS measured
    FROM verdict
)
ORDER BY ALL;

COMMENT ON TABLE verdict_criteria IS 'Every criterion of every verdict, one row each';
COMMENT ON COLUMN verdict_criteria.key IS 'Key of the crash';
COMMENT ON COLUMN verdict_criteria.accepted IS 'Whether the crash is accepted';
COMMENT ON COLUMN verdict_criteria.label IS 'What happens: verified, first_event_only or rejected';
COMMENT ON COLUMN verdict_criteria.direction_open IS 'Sides that the report leaves open, with the share of each; of the verdict';
COMMENT ON COLUMN verdict_criteria.grade IS 'Grade: corroborated or consistent; null for a rejected crash';
COMMENT ON COLUMN verdict_criteria.support IS 'Sum of the weights of all facts of the report, natural logarithm';
COMMENT ON COLUMN verdict_criteria.independent_facts IS 'Different facts that agree with the map or the course';
COMMENT ON COLUMN verdict_criteria.alternatives IS 'What else is likely beside the course that was judged, in words; of the verdict';
COMMENT ON COLUMN verdict_criteria.support_detail IS 'Why the crash is not corroborated';
COMMENT ON COLUMN verdict_criteria.hypothesis IS 'Index of the hypothesis that was judged';
COMMENT ON COLUMN verdict_criteria.rule_set IS 'Set of rules it was judged by';
COMMENT ON COLUMN verdict_criteria.criterion IS 'Name of the criterion';
COMMENT ON COLUMN verdict_criteria.vehicle_number IS 'Party it is about, if one: a vehicle, or 1000 and the number of a person';
COMMENT ON COLUMN verdict_criteria.event_number IS 'Event of the report it is about; null for collisions of two vehicles';
COMMENT ON COLUMN verdict_criteria.value IS 'What was measured, in the unit given; null if not evaluated';
COMMENT ON COLUMN verdict_criteria.threshold IS 'What it was compared with; null if it is only reported';
COMMENT ON COLUMN verdict_criteria.unit IS 'Unit of value and threshold';
COMMENT ON COLUMN verdict_criteria.passed IS 'Whether it holds; null if not evaluated';
COMMENT ON COLUMN verdict_criteria.reason IS 'What a crash is rejected for if it fails; null if it is only reported';
COMMENT ON COLUMN verdict_criteria.detail IS 'What was found in words';
