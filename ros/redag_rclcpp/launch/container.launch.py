# SPDX-FileCopyrightText: The ReDAG-RT developers
# SPDX-License-Identifier: Apache-2.0

"""Launches a ReDAG component container with components.

    ros2 launch redag_rclcpp container.launch.py
    ros2 launch redag_rclcpp container.launch.py config:=robot.yaml \
        components:="demo_nodes_cpp/demo_nodes_cpp::Talker demo_nodes_cpp/demo_nodes_cpp::Listener"

Without `components` two pipelines of the example components run, as config/example.yaml describes them.
"""

import os

from ament_index_python.packages import get_package_share_directory
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import ComposableNodeContainer
from launch_ros.descriptions import ComposableNode

PACKAGE = 'redag_rclcpp'

# Name, default, description. All but the last three are parameters of the container with the same name.
ARGUMENTS = [
    ('config', '', 'Workload file; by default that of the example, and none where `components` is given'),
    ('workers', '0', 'Callbacks at the same time; 0: what the workload says, or else one a processor'),
    ('preemption', 'auto', 'auto, os, cooperative or none'),
    ('policy', 'rate_monotonic', 'Order of callbacks'),
    ('ties', 'share', 'Of callbacks of equal priority: share (the earlier release first) or fixed'),
    ('learn', '10.0', 'Seconds in which rates and edges are learned'),
    ('metrics_period', '1.0', 'Seconds between /diagnostics and ~/metrics'),
    ('trace', '', 'Folder for results, written at the end'),
    ('save_path', 'redag_workload.yaml', 'Where ~/save writes what was learned'),
    ('lock_memory', 'false', 'Lock the memory of the process: no page faults'),
    ('watchdog', '0.0', 'Seconds; callbacks in progress for longer are named; 0: none'),
    ('inherit', 'true', 'Locks of the middleware inherit priority, where there are real-time priorities'),
    ('name', 'redag_container', 'Name of the container'),
    ('components', 'example', 'Components to load: PACKAGE/PLUGIN, separated by blanks'),
]


def example_components():
    """Describes two pipelines: 200 Hz with 1.2 ms of work, and 10 Hz with 40 ms."""
    rates = [('fast', 0.005, (0.0002, 0.0005, 0.0002)), ('slow', 0.1, (0.005, 0.03, 0.005))]
    components = []
    for namespace, period, loads in rates:
        for plugin, load in zip(['Sensor', 'Filter', 'Control'], loads):
            parameters = {'load': load}
            if plugin == 'Sensor':
                parameters['period'] = period
            components.append(
                ComposableNode(
                    package=PACKAGE,
                    plugin=f'redag_rclcpp::examples::{plugin}',
                    namespace='/' + namespace,
                    parameters=[parameters],
                ))
    return components


def named_components(text):
    components = []
    for word in text.split():
        package, slash, plugin = word.partition('/')
        if not (package and slash and plugin):
            raise ValueError(f"components: '{word}' is not PACKAGE/PLUGIN")
        components.append(ComposableNode(package=package, plugin=plugin))
    return components


def is_true(text):
    if text.lower() not in ('true', 'false'):
        raise ValueError(f"'{text}' is neither true nor false")
    return text.lower() == 'true'


def container(context):
    values = {name: LaunchConfiguration(name).perform(context) for name, _, _ in ARGUMENTS}
    is_example = values['components'] == 'example'
    if not values['config'] and is_example:
        values['config'] = os.path.join(get_package_share_directory(PACKAGE), 'config', 'example.yaml')
    return [
        ComposableNodeContainer(
            package=PACKAGE,
            executable='component_container',
            name=values['name'],
            namespace='',
            output='screen',
            # The container is linked against libredag_pi.so, which reads this variable.
            additional_env={'REDAG_PI': '1' if is_true(values['inherit']) else '0'},
            parameters=[{
                'config': values['config'],
                'workers': int(values['workers']),
                'preemption': values['preemption'],
                'policy': values['policy'],
                'ties': values['ties'],
                'learn': float(values['learn']),
                'lock_memory': is_true(values['lock_memory']),
                'watchdog': float(values['watchdog']),
                'metrics_period': float(values['metrics_period']),
                'trace': values['trace'],
                'save_path': values['save_path'],
            }],
            composable_node_descriptions=example_components() if is_example else named_components(
                values['components']),
        )
    ]


def generate_launch_description():
    arguments = [
        DeclareLaunchArgument(name, default_value=default, description=description)
        for name, default, description in ARGUMENTS
    ]
    return LaunchDescription(arguments + [OpaqueFunction(function=container)])
