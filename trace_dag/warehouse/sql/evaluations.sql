-- Agents in the place of a crash's participants. Evaluations of crashes that have changed since do not count.
CREATE TABLE evaluations AS
SELECT evaluation.*
FROM evaluation
JOIN stage_outcomes AS outcome
    ON outcome.key = evaluation.key
    AND outcome.stage = 'verdict'
    AND outcome.fingerprint = evaluation.verdict_fingerprint
ORDER BY agent, case_id, vehicle_number;

COMMENT ON TABLE evaluations IS 'Runs of agents in the place of a crash''s participants, and their outcomes';
COMMENT ON COLUMN evaluations.agent IS 'Name of the agent, and of conditions other than the usual';
COMMENT ON COLUMN evaluations.case_id IS 'Key of the crash, or of one of its variations or likely courses';
COMMENT ON COLUMN evaluations.key IS 'Key of the crash';
COMMENT ON COLUMN evaluations.vehicle_number IS 'Vehicle the agent drove';
COMMENT ON COLUMN evaluations.role IS 'striking, who closed in faster at the recorded contact, struck, or departing';
COMMENT ON COLUMN evaluations.weight IS 'Weight of a likely course among those of its crash; 1 of anything else';
COMMENT ON COLUMN evaluations.part IS 'initiator or responder, by the report';
COMMENT ON COLUMN evaluations.outcome IS 'conflict_avoided, collision_avoided, did_not_arrive, rules_broken, mitigated, unchanged, worse or faulty';
COMMENT ON COLUMN evaluations.fault IS 'Fault of a faulty agent';
COMMENT ON COLUMN evaluations.collided IS 'Whether any vehicle touched another party or a fixed object';
COMMENT ON COLUMN evaluations.overturned IS 'Whether the agent''s vehicle overturned';
COMMENT ON COLUMN evaluations.recorded_overturned IS 'Whether the same vehicle overturned in the recorded crash';
COMMENT ON COLUMN evaluations.finished IS 'Whether it came 50 m beyond the conflict, or to its end, in twice the recorded time';
COMMENT ON COLUMN evaluations.arrived IS 'Whether it got past the conflict, or to its end';
COMMENT ON COLUMN evaluations.recorded_off_road_s IS 'Time the recorded vehicle was off the road before the conflict, s';
COMMENT ON COLUMN evaluations.serious_injury_risk IS 'Risk of serious injury at the first contact, the larger of the two';
COMMENT ON COLUMN evaluations.recorded_serious_injury_risk IS 'Risk of serious injury of the recorded crash';
COMMENT ON COLUMN evaluations.contact_time_s IS 'First contact, since the scenario began, s';
COMMENT ON COLUMN evaluations.contact_shift_s IS 'First contact after the recorded one, s';
COMMENT ON COLUMN evaluations.contact_shift_m IS 'First contact from the recorded one, m';
COMMENT ON COLUMN evaluations.closing_speed_mps IS 'Closing speed at the first contact, m/s';
COMMENT ON COLUMN evaluations.delta_v_mps IS 'Delta-v of the first contact, the larger of the two; 0 if none, m/s';
COMMENT ON COLUMN evaluations.own_delta_v_mps IS 'Delta-v of the agent''s vehicle; 0 if none, m/s';
COMMENT ON COLUMN evaluations.recorded_delta_v_mps IS 'Delta-v of the recorded crash, the larger of the two, m/s';
COMMENT ON COLUMN evaluations.recorded_own_delta_v_mps IS 'Delta-v of the same vehicle in the recorded crash, m/s';
COMMENT ON COLUMN evaluations.min_ttc_s IS 'Least time to collision at constant velocities; 0 for a contact, s';
COMMENT ON COLUMN evaluations.post_encroachment_time_s IS 'Least time between two bodies in one place, s';
COMMENT ON COLUMN evaluations.required_deceleration_mps2 IS 'Greatest deceleration needed to avoid every contact, m/s2';
COMMENT ON COLUMN evaluations.off_road_s IS 'Time off the road, s';
COMMENT ON COLUMN evaluations.wrong_way_s IS 'Time in lanes of the other direction, outside junctions, s';
COMMENT ON COLUMN evaluations.over_limit_mps IS 'Most above the speed limit, m/s';
COMMENT ON COLUMN evaluations.over_traffic_mps IS 'Most above 1.25 times the limit or the recorded highest speed, m/s';
COMMENT ON COLUMN evaluations.stop_signs_passed IS 'Stop signs passed without a halt';
COMMENT ON COLUMN evaluations.max_deceleration_mps2 IS 'Hardest braking before any contact, m/s2';
COMMENT ON COLUMN evaluations.max_lateral_mps2 IS 'Hardest cornering before any contact, m/s2';
COMMENT ON COLUMN evaluations.max_jerk_mps3 IS 'Sharpest change of acceleration before any contact, m/s3';
COMMENT ON COLUMN evaluations.drive IS 'JSON: x, y, z (m) and heading (rad) by body, 20 a second, to the first contact';
COMMENT ON COLUMN evaluations.rate_hz IS 'Rate of the agent''s actions, Hz';
COMMENT ON COLUMN evaluations.range_m IS 'Range of its sensors, m';
COMMENT ON COLUMN evaluations.noise_m IS 'Noise of the positions it saw, standard deviation, m';
COMMENT ON COLUMN evaluations.occlusion IS 'Whether bodies hid others from it';
COMMENT ON COLUMN evaluations.traffic IS 'Motion of the others: recorded, reactive or persistent';
COMMENT ON COLUMN evaluations.seed IS 'Seed of the noise';
COMMENT ON COLUMN evaluations.split IS 'The part of the benchmark that was asked for: train, validation or test; empty for all';
COMMENT ON COLUMN evaluations.handed_in IS 'Whether the run was handed in as a file, not driven here';
COMMENT ON COLUMN evaluations.agent_code IS 'Digest of the agent''s own code';
COMMENT ON COLUMN evaluations.code_version IS 'Code that evaluated it';
COMMENT ON COLUMN evaluations.verdict_fingerprint IS 'Of the crash as it was evaluated';
