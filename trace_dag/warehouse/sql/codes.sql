-- What the codes mean that columns of other tables hold, in words of this project's; codes for "unknown" are left out.
CREATE TABLE codes AS
SELECT element, code, meaning
FROM code_meaning
ORDER BY element, code;

COMMENT ON TABLE codes IS 'What the codes of FARS elements mean that other tables hold';
COMMENT ON COLUMN codes.element IS 'FARS element, as the comments of columns name it';
COMMENT ON COLUMN codes.code IS 'Code';
COMMENT ON COLUMN codes.meaning IS 'The code in words';

-- For the tables that are built after this one: a code of an element in words.
CREATE TEMP MACRO meaning_of(of_element, of_code) AS (
    SELECT meaning FROM codes WHERE codes.element = of_element AND codes.code = of_code
);

-- A code of an element, null where it is one of those that say "unknown".
CREATE TEMP MACRO known_code(of_element, of_code) AS (
    SELECT code FROM codes WHERE codes.element = of_element AND codes.code = of_code
);
