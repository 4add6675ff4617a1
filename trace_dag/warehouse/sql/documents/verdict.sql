-- Every verdict with its criteria.
SELECT
    key,
    unnest(from_json(content, '{
        "accepted": "BOOLEAN", "hypothesis": "INTEGER", "rule_set": "VARCHAR",
        "criteria": [{
            "name": "VARCHAR", "value": "DOUBLE", "threshold": "DOUBLE", "unit": "VARCHAR", "passed": "BOOLEAN",
            "reason": "VARCHAR", "detail": "VARCHAR", "vehicle_number": "INTEGER"
        }]
    }'))
FROM document
