# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""A companion answers clients of a second type under the name of a service of its principal."""

from __future__ import annotations

import threading
from typing import Any

from ros_harness import call, free_domain, ros_context
from std_srvs.srv import Empty, Trigger

from push_predictor.nodes.replay.companion import CompanionNode


def test_each_client_is_answered_by_the_service_of_its_type() -> None:
    domain, reached = free_domain(), threading.Event()

    def answer(request: Any, response: Any) -> Any:
        reached.set()
        return response

    with ros_context(domain, "/cell") as principal, ros_context(domain) as one, ros_context(domain) as other:
        principal.create_service(Trigger, "~/go", lambda request, response: Trigger.Response(message="principal"))
        companion = CompanionNode(principal, "second")
        companion.node.create_service(Empty, principal.resolve_service_name("~/go"), answer)
        companion.start()
        name = f"/cell/{principal.get_name()}/go"
        assert companion.node.get_fully_qualified_name() == f"/cell/_{principal.get_name()}_second"
        assert call(one.create_client(Trigger, name), Trigger.Request(), patience=1.0).message == "principal"
        assert not reached.is_set()
        call(other.create_client(Empty, name), Empty.Request(), patience=1.0)
        assert reached.is_set()
        companion.close()
        assert not companion._thread.is_alive()
        assert call(one.create_client(Trigger, name), Trigger.Request(), patience=1.0).message == "principal"
