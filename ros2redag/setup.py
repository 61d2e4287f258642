# SPDX-FileCopyrightText: The ReDAG-RT developers
# SPDX-License-Identifier: Apache-2.0

"""The package ros2redag. package.xml alone states the version."""

import pathlib
import xml.etree.ElementTree

from setuptools import find_packages, setup

PACKAGE = 'ros2redag'
MANIFEST = xml.etree.ElementTree.parse(pathlib.Path(__file__).resolve().parent / 'package.xml').getroot()
MAINTAINER = MANIFEST.find('maintainer')

setup(
    name=PACKAGE,
    version=MANIFEST.findtext('version'),
    packages=find_packages(exclude=['test']),
    data_files=[
        ('share/' + PACKAGE, ['package.xml']),
        ('share/ament_index/resource_index/packages', ['resource/' + PACKAGE]),
    ],
    install_requires=['ros2cli'],
    zip_safe=True,
    maintainer=MAINTAINER.text,
    maintainer_email=MAINTAINER.get('email'),
    description=MANIFEST.findtext('description'),
    license=MANIFEST.findtext('license'),
    tests_require=['pytest'],
    entry_points={
        'ros2cli.command': ['redag = ros2redag.command.redag:RedagCommand'],
        'ros2cli.extension_point': ['ros2redag.verb = ros2redag.verb:VerbExtension'],
        'ros2redag.verb': [
            'report = ros2redag.verb.report:ReportVerb',
            'top = ros2redag.verb.top:TopVerb',
        ],
    },
)
