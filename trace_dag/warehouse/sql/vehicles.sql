-- The motor vehicles of every crash whose report was read.
CREATE TABLE vehicles AS
SELECT
    record.key,
    vehicle.number AS vehicle_number,
    vehicle.vehicle_class,
    vehicle.make_model,
    vehicle.model_year,
    vehicle.length_m,
    vehicle.width_m,
    vehicle.mass_kg,
    vehicle.in_transport,
    vehicle.travel_speed_mps,
    vehicle.speed_limit_mps,
    vehicle.movement AS movement_code,
    vehicle.critical_event_code,
    vehicle.crash_type_code,
    vehicle.initial_impact_code,
    vehicle.impact.clock_h AS impact_clock_h,
    vehicle.surface_condition_code,
    vehicle.trailers
FROM (SELECT key, unnest(vehicles) AS vehicle FROM crash_record) AS record
ORDER BY key, vehicle_number;

COMMENT ON TABLE vehicles IS 'The motor vehicles of every crash whose report was read';
COMMENT ON COLUMN vehicles.key IS 'Key of the crash';
COMMENT ON COLUMN vehicles.vehicle_number IS 'Number of the vehicle in the report (VEH_NO)';
COMMENT ON COLUMN vehicles.vehicle_class IS 'Kind of body it is simulated as';
COMMENT ON COLUMN vehicles.make_model IS 'Make and model as labelled';
COMMENT ON COLUMN vehicles.model_year IS 'Model year';
COMMENT ON COLUMN vehicles.length_m IS 'Length of the body, m';
COMMENT ON COLUMN vehicles.width_m IS 'Width of the body, m';
COMMENT ON COLUMN vehicles.mass_kg IS 'Mass in running order, kg';
COMMENT ON COLUMN vehicles.in_transport IS 'In transport, not parked or at work';
COMMENT ON COLUMN vehicles.travel_speed_mps IS 'Reported speed, m/s; null if not reported (TRAV_SP)';
COMMENT ON COLUMN vehicles.speed_limit_mps IS 'Speed limit, m/s (VSPD_LIM)';
COMMENT ON COLUMN vehicles.movement_code IS 'Movement before the critical event (P_CRASH1)';
COMMENT ON COLUMN vehicles.critical_event_code IS 'What made the crash imminent (P_CRASH2)';
COMMENT ON COLUMN vehicles.crash_type_code IS 'Crash type (ACC_TYPE)';
COMMENT ON COLUMN vehicles.initial_impact_code IS 'Area of the first impact as reported (IMPACT1)';
COMMENT ON COLUMN vehicles.impact_clock_h IS 'Clock position of the collision on the body, hours; 12 front, 3 right';
COMMENT ON COLUMN vehicles.surface_condition_code IS 'Condition of the road surface (VSURCOND)';
COMMENT ON COLUMN vehicles.trailers IS 'Trailing units (TOW_VEH)';
