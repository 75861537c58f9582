#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""The size check finds each function with its length, and nothing in a tree that keeps to its sizes."""
import pathlib
import tempfile
import unittest

import sizes


def body(lines):
    """Statements that fill so many lines."""
    return "  work();\n" * lines


class FunctionsTest(unittest.TestCase):
    def found(self, text):
        return [(name, length) for name, _, length in sizes.functions(text)]

    def test_functions_of_namespaces_and_classes(self):
        self.assertEqual(self.found("""
namespace a::b {
namespace {
int one(int x) {
  return x;
}
}  // namespace
class C : public D {
 public:
  explicit C(int x) : x_(x), list_{1, 2} {
    start();
  }
  ~C() {}
  bool operator==(const C& o) const { return x_ == o.x_; }
  struct Inner {
    int twice() const { return 2 * x; }
    int x = 0;
  };

 private:
  int x_ = 0, y_{1};
};
void C::two() const noexcept {
}
}  // namespace a::b
"""), [("one", 3), ("C::C", 3), ("C::~C", 1), ("C::operator==", 1), ("C::Inner::twice", 1), ("C::two", 2)])

    def test_a_signature_counts_from_its_first_line(self):
        self.assertEqual(self.found("template <class T, std::size_t N = 3>\nstd::array<T, N> all(\n    T value,\n"
                                    "    int more = {}) {\n}\n"), [("all", 5)])
        self.assertEqual(list(sizes.functions("/// What it does.\n\nint f() {\n}\n")), [("f", 3, 2)])

    def test_braces_that_open_no_body(self):
        self.assertEqual(self.found("""
enum class Kind : int { a, b };
constexpr std::array<int, 2> kTable = {
    1, 2};
const std::map<int, int> kMap{{1, 2}};
struct Options {
  int a = 1;
};
extern "C" {
int g();
}
"""), [])

    def test_constructors_with_braces_in_their_initialisers(self):
        self.assertEqual(self.found("C::C()\n    : a_{1},\n      b_(f({2})),\n      c_{} {\n  go();\n}\n"),
                         [("C::C", 6)])

    def test_lambdas_count_to_their_function_and_alone_where_they_stand_alone(self):
        self.assertEqual(self.found("void f() {\n  const auto g = [](int x) {\n    return x;\n  };\n}\n"), [("f", 5)])
        self.assertEqual(self.found("const auto g = [](int x) {\n  return x;\n};\n"), [("g", 3)])

    def test_text_and_comments_are_not_code(self):
        self.assertEqual(self.found('const char* kA = "{ void f() {";  // {\n/* { */ char b = \'{\';\nint n = 4\'000;\n'
                                    '#define X {\nconst char* r = R"(\n{ " )";\nvoid f() { log("}"); }\n'), [("f", 1)])

    def test_tests_have_their_names(self):
        self.assertEqual(self.found("TEST_F(Motion,\n       StaysPut) {\n}\n"), [("Motion.StaysPut", 3)])

    def test_trailing_types_and_requirements(self):
        self.assertEqual(self.found("auto f(int x) -> std::vector<int> {\n}\ntemplate <class T>\nvoid g(T x) "
                                    "requires(sizeof(T) < 8) {\n}\n"), [("f", 2), ("g", 3)])


class SizesTest(unittest.TestCase):
    def faults(self, files):
        """Faults of a tree that holds one clean file and `files` (text by path)."""
        with tempfile.TemporaryDirectory() as folder:
            root = pathlib.Path(folder)
            for path, text in {"src/evpose/map/clean.cpp": "void f() {\n}\n", **files}.items():
                (root / path).parent.mkdir(parents=True, exist_ok=True)
                (root / path).write_text(text)
            return sizes.check(root)

    def one(self, path, text, *words):
        found = self.faults({path: text})
        self.assertEqual(len(found), 1, found)
        for word in words:
            self.assertIn(word, found[0])

    def test_sixty_lines_are_the_most_of_a_function(self):
        fits, long = "void f() {\n" + body(58) + "}\n", "void f() {\n" + body(59) + "}\n"
        self.assertEqual(self.faults({"src/evpose/map/a.cpp": fits}), [])
        self.one("src/evpose/map/a.cpp", "\n" + long, "src/evpose/map/a.cpp:2", "f has 61 lines, at most 60")
        self.one("apps/evpose/a.h", "class C {\n" + long + "};\n", "C::f has 61 lines")
        self.one("src/evpose/map/a_test.cpp", long, "at most 60")

    def test_four_hundred_lines_are_the_most_of_a_source_and_five_hundred_of_a_test(self):
        self.assertEqual(self.faults({"src/a.cpp": "\n" * 400, "src/a_test.cpp": "\n" * 500}), [])
        self.one("src/a.h", "\n" * 401, "src/a.h: 401 lines, at most 400")
        self.one("src/a_test.cpp", "\n" * 501, "at most 500")

    def test_the_trackers_update_fits_a_screen(self):
        self.assertEqual(self.faults({"src/a.cpp": "Result Tracker::update(TimeNs t) {\n" + body(23) + "}\n"}), [])
        self.one("src/a.cpp", "Result Tracker::update(TimeNs t) {\n" + body(24) + "}\n",
                 "Tracker::update has 26 lines, at most 25")
        self.assertEqual(self.faults({"src/a.cpp": "void EventTracker::update() {\n" + body(30) + "}\n"}), [])

    def test_other_folders_and_files_are_not_looked_at(self):
        self.assertEqual(self.faults({"tests/a.cpp": "\n" * 999, "src/a.md": "\n" * 999}), [])


if __name__ == "__main__":
    unittest.main()
