-- The view that each of the two parties that met first had of the other.
CREATE TABLE sight_lines AS
SELECT
    key,
    line.driver AS party,
    line.other AS other,
    line.seen_for_s AS seen_for_s,
    line.hidden_share AS hidden_share,
    nullif(line.hidden_by, '') AS hidden_by,
    nullif(line.osm_id, '') AS osm_id
FROM (SELECT key, unnest(sight_lines) AS line FROM verdict)
ORDER BY key, party;

COMMENT ON TABLE sight_lines IS 'The times from which the two parties of the first contact could see each other';
COMMENT ON COLUMN sight_lines.key IS 'Key of the crash';
COMMENT ON COLUMN sight_lines.party IS 'The party that looks, from the driver''s or the person''s eye';
COMMENT ON COLUMN sight_lines.other IS 'The party that is looked at';
COMMENT ON COLUMN sight_lines.seen_for_s IS 'Time before the contact from which on the other is seen without a break, s; at most all that was simulated';
COMMENT ON COLUMN sight_lines.hidden_share IS 'Share of the last 5 s before the contact in which the other is hidden';
COMMENT ON COLUMN sight_lines.hidden_by IS 'What hides it longest: building, wall, hedge, a fixed object or another party; null if it is never hidden';
COMMENT ON COLUMN sight_lines.osm_id IS 'That thing in OpenStreetMap, if it is from there';
