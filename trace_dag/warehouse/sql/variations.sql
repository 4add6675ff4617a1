-- Perturbed crashes kept as scenarios for tests. Those of crashes that have changed since do not count.
CREATE TABLE variations AS
SELECT variation.*
FROM variation
JOIN stage_outcomes AS outcome
    ON outcome.key = variation.key
    AND outcome.stage = 'verdict'
    AND outcome.fingerprint = variation.verdict_fingerprint
ORDER BY variation_id;

COMMENT ON TABLE variations IS 'Perturbed crashes kept as scenarios for tests';
COMMENT ON COLUMN variations.variation_id IS 'Key of the crash and number of the variation';
COMMENT ON COLUMN variations.key IS 'Key of the crash';
COMMENT ON COLUMN variations.number IS 'Number in the crash''s family, from 1';
COMMENT ON COLUMN variations.seed IS 'Seed of the family';
COMMENT ON COLUMN variations.kind IS 'collision or near_miss';
COMMENT ON COLUMN variations.gap_m IS 'Least distance between the two bodies; 0 for a collision, m';
COMMENT ON COLUMN variations.impact_time_s IS 'When the crash would have been, s';
COMMENT ON COLUMN variations.contact_shift_m IS 'First contact from the crash''s, m';
COMMENT ON COLUMN variations.closing_speed_mps IS 'Closing speed at the first contact, m/s';
COMMENT ON COLUMN variations.friction IS 'Friction of tyres on the road';
COMMENT ON COLUMN variations.speed_factor_1 IS 'Speeds as a multiple of the recorded ones, of the first vehicle';
COMMENT ON COLUMN variations.delay_1_s IS 'How much later it comes, of the first vehicle, s';
COMMENT ON COLUMN variations.offset_left_1_m IS 'How far left of its recorded way it drives, of the first vehicle, m';
COMMENT ON COLUMN variations.reaction_1_s IS 'Time before the recorded impact at which it brakes (0: never), of the first vehicle, s';
COMMENT ON COLUMN variations.speed_factor_2 IS 'Speeds as a multiple of the recorded ones, of the second vehicle';
COMMENT ON COLUMN variations.delay_2_s IS 'How much later it comes, of the second vehicle, s';
COMMENT ON COLUMN variations.offset_left_2_m IS 'How far left of its recorded way it drives, of the second vehicle, m';
COMMENT ON COLUMN variations.reaction_2_s IS 'Time before the recorded impact at which it brakes (0: never), of the second vehicle, s';
COMMENT ON COLUMN variations.code_version IS 'Code that made it';
COMMENT ON COLUMN variations.verdict_fingerprint IS 'Of the crash it was made from';
