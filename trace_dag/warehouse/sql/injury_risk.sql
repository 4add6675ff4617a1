-- How badly people are hurt at the violence that was simulated, in verified crashes.
--
-- People struck, by the speed at which the vehicle closed on them, as in Tefft, Impact Speed and a Pedestrian's Risk of
-- Severe Injury or Death, Accident Analysis and Prevention 50, 2013: risks of severe injury (AIS 4 and more) and of death
-- of 10 and 90 % are at 17.1 and 48.1 mph, 24.1 and 54.6 mph; between them logistic. A person of 70 has the risk of one of
-- 30 at 11.8 mph more, here taken evenly over the years from the mean age of those struck, 45 (judgement).
--
-- Occupants of cars, by the change of velocity. Any direction, age and belt: (delta-v / 71 mph) to the fourth (Joksch,
-- Accident Analysis and Prevention 25, 1993). Drivers by direction, age and belt: belted and struck at the front 3 % at 30
-- mph and 92 % at 60 mph, at the side 90 % at 40 mph (Richards and Cuerden, Road Safety Web Publication 9, Department for
-- Transport, 2009), logistic, the side with the slope of the front. Without a belt 1 / 0.55 of that in a car and 1 / 0.4 in
-- a light truck, van or SUV (Kahane, DOT HS 809 199, 2000); 2.34 % more for each year of age beyond 20, the mean of men
-- and women (Evans, Journal of Traffic Medicine 29, 2001), seen from the 40 years that the drivers of the curves are taken
-- to have (judgement). Belts whose use is not told count as worn.
--
-- Serious injury (MAIS 3 and more) of occupants, by delta-v in mph and direction: the logarithm of the odds is -5.820 + 0.202
-- delta-v, and 0.556 more where struck at a side, 2.170 less at the rear; -5.450 + 0.178 delta-v of any direction (Malliaris,
-- Digges and DeBlois, Relationships between crash casualties and crash attributes, SAE 970393, 1997; as others quote them).
CREATE VIEW injury_risk AS
WITH shown AS (
    SELECT contacts.*
    FROM contacts
    JOIN verdicts USING (key, hypothesis)
    WHERE verdicts.label = 'verified'
),

struck AS (
    SELECT
        shown.key,
        shown.party_2 AS party,
        max(shown.closing_speed_mps) / 0.44704 AS closing_mph,
        max(coalesce(non_motorists.age_years, 45)) AS age_years
    FROM shown
    LEFT JOIN non_motorists ON non_motorists.key = shown.key AND non_motorists.party = shown.party_2
    WHERE shown.party_2 BETWEEN 1001 AND 1999  -- persons; some reports do not list them
    GROUP BY shown.key, shown.party_2
),

of_vehicle AS (
    SELECT key, party_1 AS party, delta_v_1_mps AS delta_v_mps FROM shown
    UNION ALL
    SELECT key, party_2, delta_v_2_mps FROM shown
),

occupied AS (
    SELECT
        of_vehicle.key,
        of_vehicle.party,
        max(of_vehicle.delta_v_mps) / 0.44704 AS delta_v_mph,
        any_value(vehicles.impact_clock_h) AS clock_h,
        any_value(vehicles.driver_age_years) AS age_years,
        any_value(vehicles.driver_belted) AS belted,
        any_value(vehicles.occupants_killed) AS killed,
        any_value(CASE WHEN vehicles.vehicle_class = 'car' THEN 0.55 ELSE 0.4 END) AS belt_leaves
    FROM of_vehicle
    JOIN vehicles ON vehicles.key = of_vehicle.key AND vehicles.vehicle_number = of_vehicle.party
    WHERE vehicles.in_transport AND vehicles.vehicle_class IN ('car', 'suv', 'pickup', 'van')
    GROUP BY of_vehicle.key, of_vehicle.party
),

belted_drivers AS (
    SELECT
        *,
        CASE
            WHEN clock_h >= 11 OR clock_h <= 1 THEN 1 / (1 + exp(-0.197 * (delta_v_mph - 47.6)))
            WHEN clock_h BETWEEN 2 AND 4 OR clock_h BETWEEN 8 AND 10 THEN 1 / (1 + exp(-0.197 * (delta_v_mph - 28.8)))
        END AS risk,
        CASE
            WHEN clock_h >= 11 OR clock_h <= 1 THEN -5.820 + 0.202 * delta_v_mph
            WHEN clock_h BETWEEN 2 AND 4 OR clock_h BETWEEN 8 AND 10 THEN -5.820 + 0.202 * delta_v_mph + 0.556
            WHEN clock_h BETWEEN 5 AND 7 THEN -5.820 + 0.202 * delta_v_mph - 2.170
            ELSE -5.450 + 0.178 * delta_v_mph
        END AS serious_log_odds
    FROM occupied
)

SELECT
    key,
    party,
    'person struck' AS who,
    closing_mph * 0.44704 AS speed_mps,
    NULL AS serious_risk,
    1 / (1 + exp(-2 * ln(9) / (48.1 - 17.1) * (closing_mph + (age_years - 45) * 11.8 / 40 - 32.6))) AS severe_risk,
    1 / (1 + exp(-2 * ln(9) / (54.6 - 24.1) * (closing_mph + (age_years - 45) * 11.8 / 40 - 39.35))) AS fatality_risk,
    NULL AS driver_fatality_risk,
    NULL AS occupants_killed
FROM struck
UNION ALL
SELECT
    key,
    party,
    'occupants',
    delta_v_mph * 0.44704,
    1 / (1 + exp(-serious_log_odds)),
    NULL,
    least((delta_v_mph / 71) ** 4, 1),
    CASE
        WHEN risk IS NOT NULL THEN least(
            risk
            * CASE WHEN belted IS FALSE THEN 1 / belt_leaves ELSE 1 END
            * 1.0234 ** (greatest(coalesce(age_years, 40), 20) - 40),
            1
        )
    END,
    killed
FROM belted_drivers
ORDER BY key, party;

COMMENT ON VIEW injury_risk IS 'Risks of injury at the simulated severity of verified crashes, by published curves';
COMMENT ON COLUMN injury_risk.key IS 'Key of the crash';
COMMENT ON COLUMN injury_risk.party IS 'Number of the person struck, or of the vehicle';
COMMENT ON COLUMN injury_risk.who IS 'person struck, or occupants of a car, SUV, pickup or van';
COMMENT ON COLUMN injury_risk.speed_mps IS 'Largest speed at which a vehicle closed on the person, or change of velocity of the vehicle, m/s';
COMMENT ON COLUMN injury_risk.serious_risk IS 'Risk of serious injury (MAIS 3 and more) of an occupant by delta-v and direction, 0 to 1 (Malliaris 1997)';
COMMENT ON COLUMN injury_risk.severe_risk IS 'Risk of severe injury (AIS 4 and more) of a person struck at that speed and age, 0 to 1 (Tefft 2013)';
COMMENT ON COLUMN injury_risk.fatality_risk IS 'Risk of death: of a person struck (Tefft 2013), of an occupant (Joksch 1993)';
COMMENT ON COLUMN injury_risk.driver_fatality_risk IS 'Risk of death of the driver by direction, belt and age; NULL where struck neither at the front nor a side';
COMMENT ON COLUMN injury_risk.occupants_killed IS 'Occupants of the vehicle that were killed, as reported';
