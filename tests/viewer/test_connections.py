"""Which connection goes when there are too many."""

from hypothesis import given
from hypothesis import strategies as st

from offboard.viewer.connections import MOST_CONNECTIONS, MOST_OF_A_CLIENT, Connections

STEPS = st.lists(
    st.tuples(
        st.sampled_from(["add", "add", "add", "asked", "answered", "remove"]), st.integers(0)
    ),
    max_size=200,
)
MANY = [("add", choice) for choice in range(MOST_CONNECTIONS - 20)]


@given(STEPS, st.integers(1, 5))
def test_there_are_never_too_many_and_who_asks_is_answered(steps, clients):
    """Against plain lists, one for each state, in the order in which they go."""
    table, client_of = Connections(), {}
    state_of = {}
    for number, (step, choice) in enumerate(MANY + steps):
        if step == "add":
            client = f"10.0.0.{choice % clients}"
            before = [client_of[c] for c in state_of]
            surplus = table.add(number, client)
            if surplus is None:
                assert before.count(client) < MOST_OF_A_CLIENT
                assert len(before) < MOST_CONNECTIONS
            else:
                loser = client_of[surplus]
                full = before.count(client) >= MOST_OF_A_CLIENT
                assert loser == client if full else len(before) == MOST_CONNECTIONS
                assert full or before.count(loser) == max(map(before.count, set(before)))
                rivals = [c for c in state_of if client_of[c] == loser]
                for state in ("answered", "add", "asked"):
                    if candidates := [c for c in rivals if state_of[c] == state]:
                        assert surplus == candidates[0]
                        break
                del state_of[surplus]
            client_of[number], state_of[number] = client, step
        elif state_of:
            connection = list(state_of)[choice % len(state_of)]
            getattr(table, step)(connection)
            state_of[connection] = step
            if step == "remove":
                del state_of[connection]
        assert len(table) == len(state_of) <= MOST_CONNECTIONS


def test_a_newcomer_never_goes_itself_and_one_client_cannot_push_out_another():
    table = Connections()
    for number in range(MOST_OF_A_CLIENT // 2):
        assert table.add(("guest", number), "guest") is None
    for number in range(4 * MOST_CONNECTIONS):
        surplus = table.add(("stranger", number), "stranger")
        assert surplus is None or surplus[0] == "stranger"
        assert surplus != ("stranger", number)
    assert len(table) == MOST_CONNECTIONS
    table.asked("unknown")
    table.answered("unknown")
    table.remove("unknown")
