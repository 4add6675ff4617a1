-- What built this warehouse: a warehouse that other code built is built again.
CREATE TABLE warehouse_build AS SELECT getvariable('code_version')::VARCHAR AS code_version;

COMMENT ON TABLE warehouse_build IS 'Versions of the program that built this warehouse';
COMMENT ON COLUMN warehouse_build.code_version IS 'Code that built it, its SQL included';
