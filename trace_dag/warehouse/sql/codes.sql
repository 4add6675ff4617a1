-- What the codes mean that columns of other tables hold, in words of this project's; codes for "unknown" are left out.
CREATE TABLE codes AS
SELECT element, code, meaning
FROM code_meaning
ORDER BY element, code;

COMMENT ON TABLE codes IS 'What the codes of FARS elements mean that other tables hold';
COMMENT ON COLUMN codes.element IS 'FARS element, as the comments of columns name it';
COMMENT ON COLUMN codes.code IS 'Code';
COMMENT ON COLUMN codes.meaning IS 'The code in words';
