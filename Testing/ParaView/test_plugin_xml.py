#!/usr/bin/env python3
# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""What the ParaView plugin says of the filters' properties is what the filters say themselves.

    test_plugin_xml.py PLUGIN.xml [unittest arguments]
"""
import sys
import unittest
import xml.etree.ElementTree as ElementTree

import bigus

XML = None
NUMBERS = ("IntVectorProperty", "DoubleVectorProperty", "IdTypeVectorProperty", "StringVectorProperty")


def proxies():
    for proxy in ElementTree.parse(XML).getroot().iter("SourceProxy"):
        kind = getattr(bigus, proxy.get("class"), None)
        if kind:  # else a class of the plugin's own
            yield proxy.get("name"), kind, proxy


def properties(proxy):
    for node in proxy:
        if node.tag in NUMBERS and node.get("command", "").startswith("Set"):
            yield node


class PluginXml(unittest.TestCase):
    def test_filters_are_in_the_menu_of_filters(self):
        """ParaView makes its menus from the two groups. What makes something from nothing is a reader or a phantom."""
        groups = {group.get("name"): {proxy.get("name") for proxy in group.iter("SourceProxy")}
                  for group in ElementTree.parse(XML).getroot().iter("ProxyGroup")}
        self.assertEqual(groups["sources"], {"BIGUSFieldReader", "BIGUSLabelReader", "BIGUSPhantom", "BIGUSSweepReader"})
        self.assertGreater(len(groups["filters"]), 8)

    def test_every_command_is_a_method(self):
        for name, kind, proxy in proxies():
            instance = kind()
            for node in proxy.iter():
                command = node.get("command")
                if command and node.tag.endswith("Property"):
                    with self.subTest(proxy=name, property=node.get("name")):
                        self.assertTrue(hasattr(instance, command), command)

    def test_every_option_of_the_trainer_is_a_property(self):
        trainer = bigus.vtkBigusTrainer()
        options = {trainer.GetOptionName(k) for k in range(trainer.GetNumberOfOptions())}
        for name, kind, proxy in proxies():
            if kind is bigus.vtkBigusTrainer:
                self.assertEqual({node.get("name") for node in properties(proxy)}, options | {"KeepStandardError"})

    def test_choices_of_the_trainer_are_accepted(self):
        """The update refuses a value that the trainer does not know."""
        sweep = bigus.vtkBigusPhantomSource()
        sweep.SetNumberOfFrames(9)
        sweep.SetFrameSize(32, 32)
        sweep.Update()
        chosen = 0
        for name, kind, proxy in proxies():
            if kind is not bigus.vtkBigusTrainer:
                continue
            for node in properties(proxy):
                for choice in node.iter("String"):
                    trainer = kind()
                    trainer.AutomaticOff()
                    trainer.SetIterations(0)
                    trainer.SetGaussians(100)
                    trainer.SetInputData(sweep.GetOutput())
                    trainer.SetOption(node.get("name"), choice.get("value"))
                    bigus.update(trainer)
                    chosen += 1
        self.assertGreater(chosen, 10)

    def test_defaults_are_the_classes(self):
        compared = 0
        for name, kind, proxy in proxies():
            instance = kind()
            for node in properties(proxy):
                getter = getattr(instance, "Get" + node.get("command")[3:], None)
                if getter is None or node.get("default_values") in (None, "none"):
                    continue
                own = getter()
                own = list(own) if isinstance(own, (tuple, list)) else [own]
                given = node.get("default_values").split() if node.tag != "StringVectorProperty" else [node.get("default_values")]
                with self.subTest(proxy=name, property=node.get("name")):
                    if node.tag == "StringVectorProperty":
                        self.assertIn(given[0], ("", own[0]))  # an empty text is the default
                    else:
                        self.assertEqual([float(value) for value in given], [float(value) for value in own])
                    compared += 1
        self.assertGreater(compared, 60)

    def test_ranges_are_the_classes(self):
        for name, kind, proxy in proxies():
            instance = kind()
            for node in properties(proxy):
                for domain in [child for child in node if child.tag in ("IntRangeDomain", "DoubleRangeDomain")]:
                    for end, suffix in (("min", "MinValue"), ("max", "MaxValue")):
                        limit = getattr(instance, "Get" + node.get("command")[3:] + suffix, None)
                        if limit and domain.get(end) is not None:
                            with self.subTest(proxy=name, property=node.get("name"), end=end):
                                self.assertGreaterEqual(float(domain.get("min")), float(getattr(
                                    instance, "Get" + node.get("command")[3:] + "MinValue")()))
                                self.assertLessEqual(float(domain.get(end)), float(getattr(
                                    instance, "Get" + node.get("command")[3:] + "MaxValue")()))

    def test_a_training_with_the_defaults_is_accepted(self):
        """Options are checked by the update: with all the plugin's defaults a tiny training runs."""
        sweep = bigus.vtkBigusPhantomSource()
        sweep.SetNumberOfFrames(9)
        sweep.SetFrameSize(32, 32)
        sweep.Update()
        for name, kind, proxy in proxies():
            if kind is not bigus.vtkBigusTrainer:
                continue
            trainer = kind()
            for node in properties(proxy):
                value = node.get("default_values")
                if value is not None and node.get("number_of_elements", "1") == "1":
                    number = {"IntVectorProperty": int, "IdTypeVectorProperty": int, "DoubleVectorProperty": float}.get(node.tag, str)
                    getattr(trainer, node.get("command"))(number(value))
            trainer.AutomaticOff()
            trainer.SetIterations(2)
            trainer.SetGaussians(100)
            trainer.SetInputData(sweep.GetOutput())
            bigus.update(trainer)
            self.assertGreater(trainer.GetOutput().GetNumberOfPoints(), 0)


if __name__ == "__main__":
    XML = sys.argv.pop(1)
    if not hasattr(bigus, "vtkBigusTrainer"):
        print("skipped: this Python has no VTK")
        sys.exit(77)
    unittest.main()
