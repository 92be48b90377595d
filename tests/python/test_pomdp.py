"""The Python package vigil_pomdp, as its wheel installs it."""

import _thread
import ast
import inspect
import os
import pathlib
import pickle
import signal
import subprocess
import sys
import tempfile
import threading
import unittest

import numpy
import vigil_pomdp as vp

from harness import ROOT

TIGER = (ROOT / "shared/pomdp/tests/pomdp/public/tiger.pomdp").read_text()
NAVIGATION = ROOT / "config/navigation.pomdp"


def tiger_value():
    """V* of the tiger at its start belief: listen until one side was heard twice more, then open."""
    same, better = 0.85**2 + 0.15**2, 0.85**2 / (0.85**2 + 0.15**2)
    opened = 10 * better - 100 * (1 - better)
    return (-1 - 0.95 + 0.95**2 * same * opened) / (1 - 0.95**2 * (same * 0.95 + 1 - same))


TIGER_VALUE = tiger_value()


def tiger():
    return vp.Model.parse(TIGER)


class Beliefs(unittest.TestCase):
    def test_a_tiger_heard_twice(self):
        tracker = vp.Tracker(tiger())
        self.assertAlmostEqual(tracker.update("listen", "hear-left"), 0.5)
        self.assertAlmostEqual(tracker.belief[0], 0.85)
        self.assertAlmostEqual(tracker.update(0, 0), 0.745)
        self.assertAlmostEqual(tracker.probability("left"), 0.969798657718)
        tracker.predict("open-left")
        self.assertEqual((tracker.belief, tracker.entropy), ([0.5, 0.5], 1.0))

    def test_soft_evidence_and_beliefs_from_elsewhere(self):
        tracker = vp.Tracker(tiger())
        self.assertAlmostEqual(tracker.weigh([0.2, 0.6]), 0.4)
        self.assertAlmostEqual(tracker.probability("left"), 0.25)
        tracker.belief = numpy.array([0.1, 0.9])
        self.assertAlmostEqual(tracker.probability(numpy.int64(1)), 0.9)
        tracker.reset()
        self.assertEqual(tracker.belief, tracker.model.start)

    def test_an_impossible_observation_is_told_and_rules_nothing_out(self):
        sharp = TIGER.replace("0.85", "1").replace("0.15", "0")
        tracker = vp.Tracker(vp.Model.parse(sharp))
        self.assertEqual(tracker.update("listen", "hear-left"), 0.5)
        self.assertEqual(tracker.update("listen", "hear-right"), 0.0)
        self.assertAlmostEqual(tracker.probability("right"), 0.005)


class Models(unittest.TestCase):
    def test_arrays_make_the_model_of_the_text(self):
        stay, half = [[1, 0], [0, 1]], [[0.5, 0.5]] * 2
        tables = [stay, half, half], [[[0.85, 0.15], [0.15, 0.85]], half, half]
        rewards = [[-1, -1], [-100, 10], [10, -100]]
        model = tiger()
        names = {
            "state_names": model.states,
            "action_names": model.actions,
            "observation_names": model.observations,
        }
        for form in (list, numpy.array):
            given = [form(table) for table in (*tables, rewards)]
            self.assertEqual(vp.Model.from_arrays(*given, discount=0.95, **names), model)
        plain = vp.Model.from_arrays(*tables, rewards, discount=0.95, start=[1, 0])
        self.assertEqual((plain.states, plain.start), (["s0", "s1"], [1.0, 0.0]))
        self.assertNotEqual(plain, model)
        mdp = vp.Model.from_arrays(tables[0], None, rewards, discount=0.95)
        self.assertEqual(mdp.observations, ["none"])

    def test_arrays_of_other_shapes_are_refused(self):
        good = [[[1.0, 0.0], [0.0, 1.0]]], [[[1.0], [1.0]]], [[0.0, 1.0]]
        vp.Model.from_arrays(*good, discount=0.9)
        for at, wrong, text in [
            (0, [], "transitions: empty"),
            (0, [[[1.0, 0.0], [1.0]]], "transitions[0][1] has 1 entries, allowed are 2"),
            (0, [[[1.0, 0.0], [0.5, 0.4]]], "T of a0 in s1: sums to 0.9, not to 1"),
            (1, [[[1.0]]], "observations[0] has 1 entries, allowed are 2"),
            (2, [[0.0], [1.0]], "rewards has 2 entries, allowed are 1"),
            (2, [[0.0, float("nan")]], "R(s1, a0) is NaN"),
        ]:
            tables = list(good)
            tables[at] = wrong
            with self.assertRaises(vp.PomdpError) as raised:
                vp.Model.from_arrays(*tables, discount=0.9)
            self.assertTrue(str(raised.exception).startswith(text), raised.exception)

    def test_models_are_read_written_compared_and_pickled(self):
        model = vp.Model.load(NAVIGATION)
        self.assertEqual(vp.Model.load(str(NAVIGATION)), model)
        self.assertEqual(vp.Model.parse(model.to_text()), model)
        self.assertEqual(pickle.loads(pickle.dumps(model)), model)
        self.assertEqual(hash(pickle.loads(pickle.dumps(model))), hash(model))
        self.assertEqual((model.discount, model.is_cost, model.warnings), (0.95, False, []))
        seen = [model.likelihood("FP", z)[0] for z in model.observations]
        self.assertAlmostEqual(sum(seen), 1)
        self.assertAlmostEqual(sum(p for _, p in model.successors(0, "FP")), 1)
        self.assertEqual(tiger().reward("left", "open-left"), -100)

    def test_what_is_wrong_is_said(self):
        with self.assertRaises(vp.ParseError) as raised:
            vp.Model.parse("discount: 0.5\nvalues: prices\n")
        error = raised.exception
        self.assertEqual((error.line, error.column), (2, 9))
        self.assertIn("'prices'", str(error))
        self.assertIsInstance(error, ValueError)
        with self.assertRaisesRegex(FileNotFoundError, "'nowhere.pomdp'"):
            vp.Model.load("nowhere.pomdp")
        model = tiger()
        tracker, policy = vp.Tracker(model), vp.heuristic(model, "qmdp")
        endless = vp.Model.parse(TIGER.replace("0.95", "1"))
        for call, text in [
            (lambda: tracker.update("sing", 0), "no action 'sing'; allowed are listen, open-left"),
            (lambda: tracker.update(0, -1), "no observation -1; allowed are 0 to 1"),
            (lambda: policy.action([0.5]), "the belief has 1 entries, allowed are 2"),
            (lambda: policy.action([0.5, 0.6]), "the belief sums to 1.1, allowed is 1"),
            (lambda: policy.action([1.5, -0.5]), "the belief holds 1.5"),
            (lambda: policy.save("x.json"), "qmdp follows from the model: no vectors"),
            (lambda: vp.heuristic(model, "luck"), "policy 'luck' is not known: allowed are mls"),
            (lambda: vp.heuristic(model, "dm-mls", threshold=2), "threshold 2: allowed is 0 to 1"),
            (lambda: vp.bound(model, "luck"), "'luck', allowed are mdp, blind"),
            (lambda: vp.solve(endless), "discount 1 needs a goal"),
            (lambda: vp.solve(model, precision=-1), "precision is -1, allowed is a number from 0"),
            (lambda: vp.solve(model, timeout_s=float("nan")), "timeout_s is NaN"),
            (lambda: vp.value(vp.heuristic(model, "dm-mls")), "dm-mls remembers"),
            (lambda: vp.simulate(model, policy, runs=1), "runs is 1, allowed is a number from 2"),
            (lambda: vp.simulate(vp.Model.load(NAVIGATION), policy), "same names in the same order"),
        ]:
            with self.assertRaises(vp.PomdpError) as raised:
                call()
            self.assertIn(text, str(raised.exception))
        with self.assertRaisesRegex(TypeError, "float, allowed is a name .str. or an index .int."):
            tracker.update(0.5, 0)


class Policies(unittest.TestCase):
    def test_the_tiger_is_solved(self):
        model = tiger()
        policy = vp.solve(model, precision=1e-5, timeout_s=None)
        self.assertLessEqual(policy.lower, TIGER_VALUE + 1e-9)
        self.assertGreaterEqual(policy.upper, TIGER_VALUE - 1e-9)
        self.assertLessEqual(policy.upper - policy.lower, 1e-5)
        self.assertEqual(policy.action([0.5, 0.5]), "listen")
        self.assertEqual(policy.action((0.97, 0.03)), "open-right")
        self.assertAlmostEqual(max(policy.values([0.5, 0.5])), TIGER_VALUE, places=4)
        lower, upper = vp.value(policy)
        self.assertAlmostEqual(lower, TIGER_VALUE, places=4)
        self.assertAlmostEqual(upper, TIGER_VALUE, places=4)

    def test_bounds_and_heuristics_are_those_of_the_literature(self):
        model = tiger()
        # The blind policy listens for ever; Q-MDP and the fast informed bound by hand.
        for method, at, wanted in [("blind", 0, -20), ("mdp", 1, 200), ("qmdp", 1, 189)]:
            self.assertAlmostEqual(vp.bound(model, method)[at], wanted, places=6)
            self.assertIsNone(vp.bound(model, method)[1 - at])
        # The most likely state of a tie is the left one: the right door is opened again and again.
        lower, upper = vp.value(vp.heuristic(model, "mls"))
        self.assertAlmostEqual(lower, -45 / 0.05)
        self.assertAlmostEqual(upper, -45 / 0.05)
        for name in ["av", "qmdp", "fib", "dm-mls", "adm-qmdp"]:
            self.assertEqual(vp.heuristic(model, name).name, name)

    def test_simulated_runs_agree_with_the_value(self):
        model = tiger()
        policy = vp.solve(model)
        mean, half_width = vp.simulate(model, policy, runs=2000, seed=3)
        self.assertEqual(vp.simulate(model, policy, runs=2000, seed=3), (mean, half_width))
        self.assertNotEqual(vp.simulate(model, policy, runs=2000, seed=4), (mean, half_width))
        self.assertLess(abs(mean - TIGER_VALUE), 2 * half_width)
        # One step is a look for -1, in any world.
        self.assertEqual(vp.simulate(model, policy, runs=5, steps=1), (-1.0, 0.0))
        deaf = vp.Model.parse(TIGER.replace("0.85", "0.6").replace("0.15", "0.4"))
        self.assertLess(vp.simulate(deaf, policy, runs=2000)[0], mean - half_width)

    def test_policies_are_kept_in_files(self):
        model = tiger()
        policy = vp.solve(model)
        with tempfile.TemporaryDirectory() as folder:
            for name in ["tiger.json", "tiger.policy", "tiger.alpha"]:
                path = pathlib.Path(folder) / name
                policy.save(path)
                read = vp.Policy.load(path, model)
                self.assertEqual(read.vectors, policy.vectors)
            own = vp.Policy.load(f"{folder}/tiger.json", model)
            self.assertEqual((own.lower, own.upper), (policy.lower, policy.upper))
            foreign = vp.Policy.load(f"{folder}/tiger.alpha", model)
            self.assertEqual((foreign.lower, foreign.name), (None, "alpha"))
            with self.assertRaisesRegex(vp.PomdpError, "no lower bound is known"):
                foreign.save(f"{folder}/again.json")
            other = vp.Model.parse(TIGER.replace("-100", "-99"))
            with self.assertRaisesRegex(vp.PomdpError, "solved for the model"):
                vp.Policy.load(f"{folder}/tiger.json", other)

    def test_fewer_vectors_earn_no_less_than_is_said(self):
        model = tiger()
        policy = vp.compact(vp.solve(model), 3)
        self.assertLessEqual(len(policy.vectors), 3)
        self.assertGreaterEqual(vp.value(policy)[1], policy.lower)
        with self.assertRaisesRegex(vp.PomdpError, "vectors_max is 0"):
            vp.compact(policy, 0)

    def test_hallway(self):
        if "VIGIL_DATA" not in os.environ:
            self.skipTest("VIGIL_DATA is not set")
        model = vp.Model.load(pathlib.Path(os.environ["VIGIL_DATA"]) / "pomdp/hallway.pomdp")
        counts = [len(names) for names in (model.states, model.actions, model.observations)]
        self.assertEqual(counts, [60, 5, 21])
        # Computed by another program.
        self.assertAlmostEqual(vp.bound(model, "qmdp")[1], 1.4589848, places=6)
        self.assertAlmostEqual(vp.bound(model, "fib")[1], 1.289371242, places=6)
        self.assertAlmostEqual(vp.bound(model, "blind")[0], 0.04723632953, places=6)
        policy = vp.solve(model, precision=0.3, timeout_s=None)
        self.assertLessEqual(policy.upper - policy.lower, 0.3)
        # What other solvers have proved of V*.
        self.assertLess(policy.lower, 1.18765)
        self.assertGreater(policy.upper, 0.99999)


class LongCalls(unittest.TestCase):
    """Another thread can only speak while a long call lets it."""

    def interrupted(self, call):
        # Started in the background, Python ignores Ctrl-C.
        before = signal.signal(signal.SIGINT, signal.default_int_handler)
        self.addCleanup(signal.signal, signal.SIGINT, before)
        threading.Timer(0.2, _thread.interrupt_main).start()
        with self.assertRaises(KeyboardInterrupt):
            call()

    def test_ctrl_c_ends_a_search(self):
        model = vp.Model.load(NAVIGATION)
        self.interrupted(lambda: vp.solve(model, precision=0, timeout_s=None))

    def test_ctrl_c_ends_a_simulation(self):
        model = tiger()
        policy = vp.heuristic(model, "qmdp")
        self.interrupted(lambda: vp.simulate(model, policy, runs=10**9, steps=10**9))

    def test_a_run_ends_at_a_goal(self):
        model = vp.Model.parse(
            "discount: 1 values: reward states: open done actions: look observations: 1 "
            "start: 1 0 T: look 0.5 0.5 0 1 O: look 1 1 R: look : open : * : * -1"
        )
        # Two looks on average; without an end it would not come back.
        mean, half_width = vp.simulate(model, vp.heuristic(model, "qmdp"), runs=2000, steps=10**12)
        self.assertLess(abs(mean + 2.0), 2.0 * half_width)

    def test_a_policy_serves_several_threads(self):
        model = tiger()
        policy = vp.solve(model)
        results = []
        simulation = lambda: results.append(vp.simulate(model, policy, runs=3000))
        threads = [threading.Thread(target=simulation) for _ in range(2)]
        for thread in threads:
            thread.start()
        for _ in range(200):
            self.assertEqual(policy.action([0.5, 0.5]), "listen")
        for thread in threads:
            thread.join()
        self.assertEqual(results[0], results[1])


class Documents(unittest.TestCase):
    def test_programs_in_documents_run(self):
        for page in ["python/README.md", "docs/library.md"]:
            program = (ROOT / page).read_text().split("```python\n")[1].split("```")[0]
            command = [sys.executable, "-c", program]
            subprocess.run(command, cwd=ROOT, check=True, stdout=subprocess.DEVNULL)

    def test_types_are_those_of_the_module(self):
        stub = ast.parse((ROOT / "python/vigil_pomdp.pyi").read_text())
        public = [node for node in stub.body if getattr(node, "name", "_")[0] != "_"]
        self.assertEqual({node.name for node in public}, set(vp.__all__))
        compared = 0
        for node in public:
            self.assertTrue(ast.get_docstring(node), node.name)
            self.assertTrue(getattr(vp, node.name).__doc__, node.name)
            if isinstance(node, ast.FunctionDef):
                compared += self.compare(node, getattr(vp, node.name))
                continue
            members = [part for part in node.body if isinstance(part, ast.FunctionDef)]
            fields = [part.target.id for part in node.body if isinstance(part, ast.AnnAssign)]
            if node.name.endswith("Error"):
                continue
            known = {member.name for member in members} | set(fields)
            shown = {name for name in vars(getattr(vp, node.name)) if name[0] != "_"}
            self.assertEqual({name for name in known if name[0] != "_"}, shown, node.name)
            for member in members:
                found = inspect.getattr_static(getattr(vp, node.name), member.name)
                self.assertTrue(getattr(found, "__doc__", None), (node.name, member.name))
                is_property = any(getattr(d, "id", "") == "property" for d in member.decorator_list)
                if member.name[0] != "_" and not is_property:
                    compared += self.compare(member, getattr(getattr(vp, node.name), member.name))
        self.assertGreater(compared, 20)

    def compare(self, node, function):
        arguments = node.args
        wanted = [a.arg for a in arguments.posonlyargs + arguments.args + arguments.kwonlyargs]
        defaults = [ast.literal_eval(d) for d in arguments.kw_defaults if d is not None]
        parameters = inspect.signature(function).parameters.values()
        self.assertEqual(wanted, [p.name for p in parameters], node.name)
        found = [p.default for p in parameters if p.default is not p.empty]
        self.assertEqual(defaults, found, node.name)
        return 1


if __name__ == "__main__":
    unittest.main()
