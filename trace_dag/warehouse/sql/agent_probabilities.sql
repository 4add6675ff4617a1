-- What an agent makes of a crash as a probability: over the likely courses of what its report leaves open, by their
-- weights. A course that is no crash when it is driven from the beginning is left out. The interval is Wilson's, of as
-- many courses of equal weight as they are worth.
CREATE VIEW agent_probabilities AS
WITH sums AS (
    SELECT
        agent,
        key,
        vehicle_number,
        count(*) AS courses,
        sum(weight) ** 2 / sum(weight ** 2) AS effective,
        coalesce(sum(weight) FILTER (outcome IN ('conflict_avoided', 'collision_avoided')), 0) / sum(weight) AS avoided,
        coalesce(sum(weight) FILTER (outcome = 'did_not_arrive'), 0) / sum(weight) AS did_not_arrive,
        coalesce(sum(weight) FILTER (outcome = 'rules_broken'), 0) / sum(weight) AS rules_broken,
        coalesce(sum(weight) FILTER (outcome = 'mitigated'), 0) / sum(weight) AS mitigated,
        coalesce(sum(weight) FILTER (outcome = 'worse'), 0) / sum(weight) AS worse,
        1.959964 ** 2 / effective AS z2
    FROM evaluations
    WHERE starts_with(case_id, key || '-c') AND recorded_delta_v_mps IS DISTINCT FROM 0
    GROUP BY agent, key, vehicle_number
),

intervals AS (
    SELECT
        *,
        (avoided + z2 / 2) / (1 + z2) AS middle,
        sqrt(z2 * avoided * (1 - avoided) + z2 ** 2 / 4) / (1 + z2) AS half
    FROM sums
)

SELECT
    agent,
    key,
    vehicle_number,
    courses,
    effective,
    avoided,
    greatest(middle - half, 0.0) AS avoided_low,
    least(middle + half, 1.0) AS avoided_high,
    did_not_arrive,
    rules_broken,
    mitigated,
    worse
FROM intervals
ORDER BY agent, key, vehicle_number;

COMMENT ON VIEW agent_probabilities IS 'Probabilities of each agent''s outcomes in a crash, over its likely courses';
COMMENT ON COLUMN agent_probabilities.agent IS 'Name of the agent, and of conditions other than the usual';
COMMENT ON COLUMN agent_probabilities.key IS 'Key of the crash';
COMMENT ON COLUMN agent_probabilities.vehicle_number IS 'Vehicle the agent drove';
COMMENT ON COLUMN agent_probabilities.courses IS 'Likely courses it drove in';
COMMENT ON COLUMN agent_probabilities.effective IS 'How many courses of equal weight they are worth';
COMMENT ON COLUMN agent_probabilities.avoided IS 'Probability that it passes by the rules and no party touches another';
COMMENT ON COLUMN agent_probabilities.avoided_low IS 'Lower end of its 95 % interval';
COMMENT ON COLUMN agent_probabilities.avoided_high IS 'Upper end of its 95 % interval';
COMMENT ON COLUMN agent_probabilities.did_not_arrive IS 'Probability that no party touches another and it never passes the conflict';
COMMENT ON COLUMN agent_probabilities.rules_broken IS 'Probability that it gets past off the road or faster than traffic drives';
COMMENT ON COLUMN agent_probabilities.mitigated IS 'Probability of a risk of serious injury lower by more than a tenth';
COMMENT ON COLUMN agent_probabilities.worse IS 'Probability of a risk higher by more than a tenth';
