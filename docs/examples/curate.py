"""Curate by script: python curate.py ADDRESS DATASET VERSION

Accepts what passes and is certain, defers what passes and is not, leaves the rest to people, and freezes
what was accepted. Everything here can be taken back in the browser.
"""

import sys

from touchline import Client
from touchline.errors import ServerError, StaleError

address, dataset, name = sys.argv[1:4]
SURE_M = 0.25

with Client(address) as client:
    waiting = list(client.pages("groups", dataset=dataset, q="status:unreviewed passes:yes"))
    counts = {"accepted": 0, "deferred": 0, "changed meanwhile": 0}
    for row in waiting:
        sure = row["sigma_m"] is not None and row["sigma_m"] < SURE_M and row["pictures"] > 0
        state = "accepted" if sure else "deferred"
        group = client.get(f"groups/{row['id']}")
        if group["verdict"]["state"] != "unreviewed":
            counts["changed meanwhile"] += 1  # judged since the list was read: that verdict stays
            continue
        try:
            client.put(f"groups/{row['id']}/verdict", {"state": state}, if_match=group)
        except StaleError:
            state = "changed meanwhile"  # edited or judged since it was read
        counts[state] += 1
    print(", ".join(f"{count} {state}" for state, count in counts.items()))
    try:
        plan = client.post(f"datasets/{dataset}/versions", {"name": name}, params={"dry_run": True})
    except ServerError as error:
        sys.exit(f"No version was made: {error}")  # no group can be in it, or it exists
    print(f"{plan['groups']} groups would enter version {name}; left out: {plan['left_out']}")
    job = client.wait(client.post(f"datasets/{dataset}/versions", {"name": name}))
    print(job["sentence"])
