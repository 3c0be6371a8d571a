// A plain reader of logs of touches: std::from_chars on every word, into columns. No findings, no check of the sum.
//
//     log_read FILE REPEATS        prints: seconds (fastest), touches, sum of X
#include <charconv>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

struct Columns {
  std::vector<long> id;
  std::vector<char> status;
  std::vector<double> x, y, z, a, b, c, check;
};

static void read(const std::string &text, Columns &out) {
  const char *p = text.data(), *end = p + text.size();
  while (p < end) {
    const char *stop = static_cast<const char *>(memchr(p, '\n', end - p));
    if (!stop) stop = end;
    if (*p == 'P') {
      ++p;
      while (p < stop) {
        if (*p == ' ' || *p == '\r') { ++p; continue; }
        const char letter = *p++;
        while (p < stop && *p == ' ') ++p;
        if (letter == 'N' || letter == 'S') {
          long value = 0;
          p = std::from_chars(p, stop, value).ptr;
          if (letter == 'N') out.id.push_back(value); else out.status.push_back(static_cast<char>(value));
          continue;
        }
        bool negative = false;
        if (*p == '-') { negative = true; ++p; while (p < stop && *p == ' ') ++p; }
        double value = 0;
        p = std::from_chars(p, stop, value).ptr;
        if (negative) value = -value;
        switch (letter) {
          case 'X': out.x.push_back(value); break;
          case 'Y': out.y.push_back(value); break;
          case 'Z': out.z.push_back(value); break;
          case 'A': out.a.push_back(value); break;
          case 'B': out.b.push_back(value); break;
          case 'C': out.c.push_back(value); break;
          case 'K': out.check.push_back(value); break;
          default: fprintf(stderr, "unknown word %c\n", letter); exit(1);
        }
      }
    }
    p = stop + 1;
  }
}

int main(int argc, char **argv) {
  if (argc != 3) { fprintf(stderr, "log_read FILE REPEATS\n"); return 2; }
  std::ifstream file(argv[1], std::ios::binary);
  const std::string text((std::istreambuf_iterator<char>(file)), std::istreambuf_iterator<char>());
  double best = 1e300, sum = 0;
  size_t count = 0;
  for (int i = 0; i < atoi(argv[2]); ++i) {
    Columns columns;
    const auto begin = std::chrono::steady_clock::now();
    read(text, columns);
    const std::chrono::duration<double> took = std::chrono::steady_clock::now() - begin;
    if (took.count() < best) best = took.count();
    sum = 0;
    for (double v : columns.x) sum += v;
    count = columns.id.size();
  }
  printf("%.9g %zu %.17g\n", best, count, sum);
}
