-- Every stored file that still counts, with the digest that later stages name it by.
CREATE TABLE artefacts AS
SELECT key, stage, file, bytes, sha256
FROM artefact
ORDER BY key, file;

COMMENT ON TABLE artefacts IS 'Every stored file of current results';
COMMENT ON COLUMN artefacts.key IS 'Key of the crash';
COMMENT ON COLUMN artefacts.stage IS 'Stage that made it';
COMMENT ON COLUMN artefacts.file IS 'Its name below the storage root';
COMMENT ON COLUMN artefacts.bytes IS 'Size, bytes';
COMMENT ON COLUMN artefacts.sha256 IS 'SHA-256 of its content, hexadecimal';
