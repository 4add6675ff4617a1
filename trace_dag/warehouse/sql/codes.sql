-- What the codes mean that columns of other tables hold, in words of this project's; codes for "unknown" are left out.
CREATE TABLE codes AS
SELECT element, code, meaning
FROM code_meaning
ORDER BY element, code;

COMMENT ON TABLE codes IS 'Meanings of the FARS codes in other tables';
COMMENT ON COLUMN codes.element IS 'FARS element, as the comments of columns name it';
COMMENT ON COLUMN codes.code IS 'Code';
COMMENT ON COLUMN codes.meaning IS 'The code in words';

-- For the tables that are built after this one: a code of an element in words. Looked up in a map of maps, since a
-- subquery for each of twenty columns takes DuckDB longer to plan than all tables to fill.
SET VARIABLE meanings = (
    SELECT map_from_entries(list((element, of_element)))
    FROM (SELECT element, map_from_entries(list((code, meaning))) AS of_element FROM codes GROUP BY element)
);
CREATE TEMP MACRO meaning_of(of_element, of_code) AS getvariable('meanings')[of_element][of_code];

-- A code of an element, null where it is one of those that say "unknown".
CREATE TEMP MACRO known_code(of_element, of_code) AS CASE WHEN meaning_of(of_element, of_code) IS NOT NULL THEN of_code END;
