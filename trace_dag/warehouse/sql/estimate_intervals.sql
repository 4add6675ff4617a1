-- How sure an estimate is: each quantity of the best hypothesis, and where four in five draws have it.
CREATE TABLE estimate_intervals AS
SELECT
    key,
    found.quantity,
    found.party,
    found.unit,
    found.best,
    found.low,
    found.middle,
    found.high,
    CASE found.unit WHEN 'm/s' THEN found.best / 0.44704 END AS best_mph,
    CASE found.unit WHEN 'm/s' THEN found.low / 0.44704 END AS low_mph,
    CASE found.unit WHEN 'm/s' THEN found.high / 0.44704 END AS high_mph,
    drawn,
    contacts,
    effective
FROM (SELECT key, drawn, len(contacts) AS contacts, effective, unnest(intervals) AS found FROM sampled)
ORDER BY key, found.quantity, found.party;

COMMENT ON TABLE estimate_intervals IS 'Intervals of speeds, changes of velocity, place and angle, over weighted draws of the values that the report leaves open';
COMMENT ON COLUMN estimate_intervals.key IS 'Key of the crash';
COMMENT ON COLUMN estimate_intervals.quantity IS 'Of the first contact: impact_speed, delta_v, contact_x, contact_y (east and north of the reported point), heading_angle';
COMMENT ON COLUMN estimate_intervals.party IS 'Number of the party; NULL of what belongs to the crash';
COMMENT ON COLUMN estimate_intervals.unit IS 'm/s, m or deg';
COMMENT ON COLUMN estimate_intervals.best IS 'Of the first hypothesis that has a contact';
COMMENT ON COLUMN estimate_intervals.low IS 'One in ten draws, by weight, is below';
COMMENT ON COLUMN estimate_intervals.middle IS 'Median of the draws';
COMMENT ON COLUMN estimate_intervals.high IS 'One in ten draws is above';
COMMENT ON COLUMN estimate_intervals.best_mph IS 'best of a speed or delta-v, mph; null of places and angles';
COMMENT ON COLUMN estimate_intervals.low_mph IS 'low, mph';
COMMENT ON COLUMN estimate_intervals.high_mph IS 'high, mph';
COMMENT ON COLUMN estimate_intervals.drawn IS 'Draws that were simulated';
COMMENT ON COLUMN estimate_intervals.contacts IS 'Those of them that came to a contact that the report does not exclude';
COMMENT ON COLUMN estimate_intervals.effective IS 'Draws of equal weight that they are worth; below 2 an interval is the value of one draw';
