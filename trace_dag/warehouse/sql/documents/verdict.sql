-- Every verdict with its criteria.
SELECT
    key,
    unnest(from_json(content, '{
        "accepted": "BOOLEAN", "grade": "VARCHAR", "hypothesis": "INTEGER", "rule_set": "VARCHAR",
        "criteria": [{
            "name": "VARCHAR", "value": "DOUBLE", "threshold": "DOUBLE", "unit": "VARCHAR", "passed": "BOOLEAN",
            "reason": "VARCHAR", "detail": "VARCHAR", "vehicle_number": "INTEGER", "event_number": "INTEGER"
        }],
        "support": {
            "total": "DOUBLE", "independent_facts": "INTEGER", "detail": "VARCHAR",
            "facts": [{
                "name": "VARCHAR", "against": "VARCHAR", "agreement": "VARCHAR", "reported": "VARCHAR",
                "found": "VARCHAR", "essential": "BOOLEAN", "vehicle_number": "INTEGER", "weight": "DOUBLE"
            }]
        }
    }'))
FROM document
