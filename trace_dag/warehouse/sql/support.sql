-- Every fact of a report that could be compared with the map, the simulated course or the report itself.
CREATE TABLE support AS
SELECT
    key,
    grade,
    fact.name AS fact,
    fact.against AS against,
    fact.vehicle_number AS vehicle_number,
    fact.reported AS reported,
    fact.found AS found,
    fact.agreement AS agreement,
    fact.agreement = 'agrees' AS agreed,
    fact.essential AS essential,
    fact.weight AS weight
FROM (SELECT key, grade, unnest(support.facts) AS fact FROM verdict)
ORDER BY ALL;

COMMENT ON TABLE support IS 'Support of each verdict, one row per fact of the report';
COMMENT ON COLUMN support.key IS 'Key of the crash';
COMMENT ON COLUMN support.grade IS 'Grade: corroborated or consistent; null for a rejected crash';
COMMENT ON COLUMN support.fact IS 'Name of the fact';
COMMENT ON COLUMN support.against IS 'What it is compared with: map, course (as simulated) or record (other fields of the report)';
COMMENT ON COLUMN support.vehicle_number IS 'Vehicle it is about, if one';
COMMENT ON COLUMN support.reported IS 'Value of the report; for a contradiction, the sentence';
COMMENT ON COLUMN support.found IS 'Value of the map or the course';
COMMENT ON COLUMN support.agreement IS 'agrees, near or differs';
COMMENT ON COLUMN support.agreed IS 'Whether it agrees';
COMMENT ON COLUMN support.essential IS 'Whether a difference forbids corroboration, whatever else agrees';
COMMENT ON COLUMN support.weight IS 'Its part of the support: a log-likelihood ratio (natural logarithm), shared among the vehicles it is reported of';
