-- Every contact of every simulated hypothesis, in the crash's local frame.
CREATE TABLE contacts AS
SELECT
    key,
    hypothesis,
    contact.time_s AS time_s,
    contact.duration_s,
    contact.x_m,
    contact.y_m,
    contact.number_1 AS party_1,
    contact.number_2 AS party_2,
    contact.closing_speed_mps,
    contact.impulse_ns,
    sqrt(contact.delta_v_1_mps[1] ** 2 + contact.delta_v_1_mps[2] ** 2) AS delta_v_1_mps,
    sqrt(contact.delta_v_2_mps[1] ** 2 + contact.delta_v_2_mps[2] ** 2) AS delta_v_2_mps,
    contact.crush_1_m,
    contact.crush_2_m
FROM (SELECT key, hypothesis, unnest(contacts) AS contact FROM simulation)
ORDER BY key, hypothesis, time_s;

COMMENT ON TABLE contacts IS 'Every contact of every simulated hypothesis';
COMMENT ON COLUMN contacts.key IS 'Key of the crash';
COMMENT ON COLUMN contacts.hypothesis IS 'Index of the hypothesis in the estimate';
COMMENT ON COLUMN contacts.time_s IS 'Time of first touching, s from the start';
COMMENT ON COLUMN contacts.duration_s IS 'How long the bodies pressed each other, s';
COMMENT ON COLUMN contacts.x_m IS 'Place of first touching, east of the reported point, m';
COMMENT ON COLUMN contacts.y_m IS 'Place of first touching, north of the reported point, m';
COMMENT ON COLUMN contacts.party_1 IS 'One party';
COMMENT ON COLUMN contacts.party_2 IS 'The other party';
COMMENT ON COLUMN contacts.closing_speed_mps IS 'Speed at which they closed, m/s';
COMMENT ON COLUMN contacts.impulse_ns IS 'Impulse over the contact, N s';
COMMENT ON COLUMN contacts.delta_v_1_mps IS 'Change of velocity of the one party, m/s';
COMMENT ON COLUMN contacts.delta_v_2_mps IS 'Change of velocity of the other, m/s';
COMMENT ON COLUMN contacts.crush_1_m IS 'How deep the one party was pressed in at most, m';
COMMENT ON COLUMN contacts.crush_2_m IS 'How deep the other was, m';
