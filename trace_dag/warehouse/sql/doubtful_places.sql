-- Accepted crashes whose place is not what the report or the map says: somebody is off mapped ground or in a building
-- before the first event, or the crash stands on a street that the report contradicts. There should be none.
CREATE VIEW doubtful_places AS
SELECT key, criterion AS what, detail
FROM verdict_criteria
WHERE accepted AND criterion = 'mapped_ground' AND passed IS NOT TRUE
UNION ALL
SELECT key, fact, reported || ' is reported, the map has ' || found
FROM support
WHERE grade IS NOT NULL AND fact IN ('first street', 'carriageways') AND agreement = 'differs'
ORDER BY ALL;

COMMENT ON VIEW doubtful_places IS 'Accepted crashes off mapped ground, through a building, or on a street that the report contradicts';
COMMENT ON COLUMN doubtful_places.key IS 'Key of the crash';
COMMENT ON COLUMN doubtful_places.what IS 'Subject of the doubt: mapped_ground, first street or carriageways';
COMMENT ON COLUMN doubtful_places.detail IS 'What was found, in words';
