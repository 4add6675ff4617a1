-- Traffic around verified crashes by class of road. That of crashes that have changed since does not count.
CREATE TABLE traffic AS
SELECT traffic_row.*
FROM traffic_row
JOIN stage_outcomes AS outcome
    ON outcome.key = traffic_row.key
    AND outcome.stage = 'verdict'
    AND outcome.fingerprint = traffic_row.verdict_fingerprint
ORDER BY traffic_row.key, traffic_class;

COMMENT ON TABLE traffic IS 'Traffic around verified crashes by class of road, measured in the minute before they begin';
COMMENT ON COLUMN traffic.key IS 'Key of the crash';
COMMENT ON COLUMN traffic.traffic_class IS 'interstate, arterial, collector or local';
COMMENT ON COLUMN traffic.rural IS 'Whether the area is rural';
COMMENT ON COLUMN traffic.weekend IS 'Whether it was on a Saturday or Sunday';
COMMENT ON COLUMN traffic.hour IS 'Hour of the day';
COMMENT ON COLUMN traffic.factor IS 'Multiple of the tables'' volumes that was asked for';
COMMENT ON COLUMN traffic.seed IS 'Seed of the arrivals and routes';
COMMENT ON COLUMN traffic.lane_km IS 'Length of the class''s lanes on the map, km';
COMMENT ON COLUMN traffic.table_volume IS 'Vehicles an hour and lane by the tables, with the factor';
COMMENT ON COLUMN traffic.limit_mps IS 'Mean speed limit of its lanes, m/s';
COMMENT ON COLUMN traffic.volume IS 'Vehicles an hour and lane as simulated';
COMMENT ON COLUMN traffic.speed_mps IS 'Mean speed as simulated, over vehicles and moments, m/s';
COMMENT ON COLUMN traffic.density_per_km IS 'Vehicles a km of lane as simulated';
COMMENT ON COLUMN traffic.vehicles IS 'Vehicles on the whole map while the crash goes on';
COMMENT ON COLUMN traffic.left_out IS 'Vehicles left out so that the crash stays as it is';
COMMENT ON COLUMN traffic.code_version IS 'Code that made it';
COMMENT ON COLUMN traffic.verdict_fingerprint IS 'Of the crash it was made for';
