# Copyright 2026 The push_predictor authors
# SPDX-License-Identifier: Apache-2.0

"""ThreadedService: a service that answers without an executor."""

from __future__ import annotations

import threading
import time

import pytest
import ros_harness as harness
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile
from std_srvs.srv import Trigger

from push_predictor.nodes.server.threaded_service import ThreadedService

DEPTH = QoSProfile(depth=100)


@pytest.fixture(scope="module")
def client_node():
    with harness.ros_context(harness.free_domain()) as node:
        yield node


@pytest.fixture
def server(client_node):
    node = Node("server", context=client_node.context)
    yield node
    node.destroy_node()


def thread_name(request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
    response.success, response.message = True, threading.current_thread().name
    return response


def test_executor_ignores_it_and_serves_the_other_services(client_node, server):
    service = ThreadedService(server, Trigger, "direct", thread_name, DEPTH)
    service.start()
    server.create_service(Trigger, "usual", thread_name, qos_profile=DEPTH)
    clients = {name: client_node.create_client(Trigger, name, qos_profile=DEPTH) for name in ("direct", "usual")}
    executor = SingleThreadedExecutor(context=client_node.context)
    executor.add_node(server)
    spinning = threading.Thread(target=executor.spin, name="executor")
    spinning.start()
    try:
        for _ in range(20):
            names = {name: harness.call(client, Trigger.Request()).message for name, client in clients.items()}
            assert names == {"direct": "direct", "usual": "executor"}
    finally:
        service.close()
        executor.shutdown()
        spinning.join()


def test_requests_queue_until_start_and_close_answers_the_queue(client_node, server):
    def slow(request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        time.sleep(0.01)
        return thread_name(request, response)

    service = ThreadedService(server, Trigger, "late", slow, DEPTH)
    client = client_node.create_client(Trigger, "late", qos_profile=DEPTH)
    assert client.wait_for_service(harness.START_TIMEOUT)
    futures = [client.call_async(Trigger.Request()) for _ in range(30)]
    assert not harness.wait_until(lambda: any(future.done() for future in futures), 0.3)
    service.start()
    assert harness.wait_until(lambda: futures[0].done())
    service.close()
    assert harness.wait_until(lambda: all(future.done() for future in futures))


def test_exception_in_the_callback_is_logged_and_the_next_request_answered(client_node, server, capfd):
    def broken_once(request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        if not asked:
            asked.append(request)
            raise ZeroDivisionError("a bug")
        return thread_name(request, response)

    asked: list[Trigger.Request] = []
    service = ThreadedService(server, Trigger, "broken", broken_once, DEPTH)
    service.start()
    client = client_node.create_client(Trigger, "broken", qos_profile=DEPTH)
    assert client.wait_for_service(harness.START_TIMEOUT)
    unanswered = client.call_async(Trigger.Request())
    assert harness.call(client, Trigger.Request()).success
    assert not unanswered.done()
    assert "ZeroDivisionError: a bug" in capfd.readouterr().err
    service.close()


def test_close_ends_the_thread_and_destroys_the_service(client_node, server):
    for _ in range(3):  # the service can be created again
        service = ThreadedService(server, Trigger, "passing", thread_name, DEPTH)
        service.start()
        client = client_node.create_client(Trigger, "passing", qos_profile=DEPTH)
        assert harness.call(client, Trigger.Request()).success
        service.close()
        assert "passing" not in [thread.name for thread in threading.enumerate()]
        assert harness.wait_until(lambda ready=client.service_is_ready: not ready())
        client_node.destroy_client(client)
