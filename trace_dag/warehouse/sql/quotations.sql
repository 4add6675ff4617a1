-- The words of narratives that fields of records were read from.
CREATE TABLE quotations AS
SELECT
    record.key,
    record.number,
    quotation.of AS part,
    quotation.field,
    quotation.words
FROM (
    SELECT key, unnest(quotations) AS quotation, generate_subscripts(quotations, 1) AS number FROM crash_record
) AS record
ORDER BY record.key, record.number;

COMMENT ON TABLE quotations IS 'The words of narratives from which fields of records were read';
COMMENT ON COLUMN quotations.key IS 'Key of the crash';
COMMENT ON COLUMN quotations.number IS 'Number among those of the crash';
COMMENT ON COLUMN quotations.part IS 'The crash, or a vehicle, person or event by its number';
COMMENT ON COLUMN quotations.field IS 'Field of the record';
COMMENT ON COLUMN quotations.words IS 'Words of the narrative, as they stand there';
