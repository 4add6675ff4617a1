-- Every verdict with its criteria.
SELECT
    unnest(from_json(content, '{
        "key": "VARCHAR", "accepted": "BOOLEAN", "hypothesis": "INTEGER", "rule_set": "VARCHAR",
        "criteria": [{
            "name": "VARCHAR", "value": "DOUBLE", "threshold": "DOUBLE", "unit": "VARCHAR", "passed": "BOOLEAN",
            "reason": "VARCHAR", "detail": "VARCHAR", "vehicle_number": "INTEGER"
        }]
    }'))
FROM read_text(getvariable('files'))
WHERE size > 2
