#include "cairn/depth/depth_map.h"

#include <bit>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>

#include "cairn/base/error.h"
#include "support/temp_folder.h"
#include "support/test.h"

namespace cairn {
namespace {

class ReadDepthMapTest : public ::testing::Test {
 protected:
  std::string Write(const std::string& name, const std::string& bytes) {
    const std::string path = folder_ / name;
    std::ofstream(path, std::ios::binary) << bytes;
    return path;
  }

  TempFolder folder_;
};

template <class T>
std::string Bytes(std::initializer_list<T> values) {
  std::string bytes;
  for (const T value : values) bytes.append(reinterpret_cast<const char*>(&value), sizeof(T));
  return bytes;
}

std::string Npy(const std::string& type, const std::string& shape, const std::string& data,
                const std::string& order = "False") {
  const std::string header =
      "{'descr': '" + type + "', 'fortran_order': " + order + ", 'shape': " + shape + ", }\n";
  std::string bytes("\x93NUMPY\x01\x00", 8);
  const uint16_t length = static_cast<uint16_t>(header.size());
  bytes.append(reinterpret_cast<const char*>(&length), 2);
  return bytes + header + data;
}

std::string ReasonOf(const std::string& path) {
  try {
    ReadDepthMap(path, {});
  } catch (const IoError& error) {
    EXPECT_EQ(error.path(), path);
    return error.reason();
  }
  return "no error";
}

TEST_F(ReadDepthMapTest, NpyOfEveryType) {
  const std::string shape = "(2, 3)";
  const std::vector<std::pair<std::string, std::string>> files = {
      {"<f4", Bytes<float>({1, 2, 3, 4, 5, 6})},
      {"<f8", Bytes<double>({1, 2, 3, 4, 5, 6})},
      {"<f2", Bytes<uint16_t>({0x3C00, 0x4000, 0x4200, 0x4400, 0x4500, 0x4600})},
      {"<u2", Bytes<uint16_t>({1, 2, 3, 4, 5, 6})},
      {"|u1", Bytes<uint8_t>({1, 2, 3, 4, 5, 6})}};
  for (const auto& [type, data] : files) {
    const DepthMap map = ReadDepthMap(Write("map.npy", Npy(type, shape, data)), {});
    EXPECT_EQ(map.width, 3) << type;
    EXPECT_EQ(map.height, 2) << type;
    EXPECT_THAT(map.values, ElementsAre(1, 2, 3, 4, 5, 6)) << type;
    EXPECT_EQ(map.NumValid(), 6) << type;
  }
}

TEST_F(ReadDepthMapTest, HalfFloatsBelowOne) {
  // 0.5, the smallest normal, a subnormal, infinity.
  const std::string data = Bytes<uint16_t>({0x3800, 0x0400, 0x0001, 0x7C00});
  const DepthMap map = ReadDepthMap(Write("map.npy", Npy("<f2", "(1, 4)", data)), {});
  EXPECT_THAT(map.values, ElementsAre(0.5f, std::ldexp(1.f, -14), std::ldexp(1.f, -24), 0.f));
  EXPECT_THAT(map.is_valid, ElementsAre(1, 1, 1, 0));
}

TEST_F(ReadDepthMapTest, NpyWithLeadingOnes) {
  const std::string data = Bytes<float>({1, 2, 3, 4});
  EXPECT_EQ(ReadDepthMap(Write("a.npy", Npy("<f4", "(1, 2, 2)", data)), {}).width, 2);
  EXPECT_EQ(ReadDepthMap(Write("b.npy", Npy("<f4", "(1, 1, 4, 1)", data)), {}).height, 4);
}

// What NumPy saves of a transposed array.
TEST_F(ReadDepthMapTest, NpyInFortranOrder) {
  const std::string data = Bytes<float>({1, 4, 2, 5, 3, 6});
  const DepthMap map = ReadDepthMap(Write("a.npy", Npy("<f4", "(2, 3)", data, "True")), {});
  EXPECT_EQ(map.width, 3);
  EXPECT_THAT(map.values, ElementsAre(1, 2, 3, 4, 5, 6));
}

TEST_F(ReadDepthMapTest, PfmOfBothByteOrders) {
  const std::string little = "Pf\n2 2\n-1.0\n" + Bytes<float>({3, 4, 1, 2});
  EXPECT_THAT(ReadDepthMap(Write("a.pfm", little), {}).values, ElementsAre(1, 2, 3, 4));
  const std::string windows = "Pf\r\n2 2\r\n-1.0\r\n" + Bytes<float>({3, 4, 1, 2});
  EXPECT_THAT(ReadDepthMap(Write("c.pfm", windows), {}).values, ElementsAre(1, 2, 3, 4));
  std::string big = "Pf\n2 1\n1.0\n";
  for (const float value : {5.f, 6.f}) {
    big += Bytes<uint32_t>({__builtin_bswap32(std::bit_cast<uint32_t>(value))});
  }
  EXPECT_THAT(ReadDepthMap(Write("b.pfm", big), {}).values, ElementsAre(5, 6));
}

TEST_F(ReadDepthMapTest, ColmapBin) {
  const std::string bytes = "3&2&1&" + Bytes<float>({1, 2, 3, 4, 0, 6});
  const DepthMap map = ReadDepthMap(Write("a.jpg.geometric.bin", bytes), {});
  EXPECT_THAT(map.values, ElementsAre(1, 2, 3, 4, 0, 6));
  EXPECT_THAT(map.is_valid, ElementsAre(1, 1, 1, 1, 0, 1));
}

TEST_F(ReadDepthMapTest, SixteenBitPngWithScale) {
  // 2 x 1, values 1000 and 0: written by hand, no compression.
  static constexpr unsigned char kPng[] = {
      0x89, 0x50, 0x4e, 0x47, 0x0d, 0x0a, 0x1a, 0x0a, 0x00, 0x00, 0x00, 0x0d, 0x49, 0x48, 0x44,
      0x52, 0x00, 0x00, 0x00, 0x02, 0x00, 0x00, 0x00, 0x01, 0x10, 0x00, 0x00, 0x00, 0x00, 0x81,
      0xd9, 0xfc, 0x15, 0x00, 0x00, 0x00, 0x10, 0x49, 0x44, 0x41, 0x54, 0x78, 0x01, 0x01, 0x05,
      0x00, 0xfa, 0xff, 0x00, 0x03, 0xe8, 0x00, 0x00, 0x02, 0xc9, 0x00, 0xec, 0x36, 0xbf, 0x43,
      0xc1, 0x00, 0x00, 0x00, 0x00, 0x49, 0x45, 0x4e, 0x44, 0xae, 0x42, 0x60, 0x82};
  const std::string bytes(reinterpret_cast<const char*>(kPng), sizeof(kPng));
  DepthOptions options;
  options.scale = 0.001;
  const DepthMap map = ReadDepthMap(Write("a.png", bytes), options);
  EXPECT_THAT(map.values, ElementsAre(1, 0));
  EXPECT_THAT(map.is_valid, ElementsAre(1, 0));
}

TEST_F(ReadDepthMapTest, BrokenFilesAreNamedWithTheReason) {
  const std::string data = Bytes<float>({1, 2, 3, 4});
  const std::string good = Npy("<f4", "(2, 2)", data);
  EXPECT_EQ(ReasonOf(folder_ / "absent.npy"), "No such file or directory");
  EXPECT_EQ(ReasonOf(folder_.path()), "is a folder, not a file");
  EXPECT_EQ(ReasonOf(Write("empty.npy", "")), "empty file");
  EXPECT_THAT(ReasonOf(Write("a.npy", good.substr(0, good.size() - 1))), HasSubstr("truncated"));
  EXPECT_THAT(ReasonOf(Write("a.npy", good.substr(0, 30))), HasSubstr("truncated"));
  EXPECT_THAT(ReasonOf(Write("a.npy", "hello, this is text")), HasSubstr("not a .npy"));
  EXPECT_THAT(ReasonOf(Write("a.npy", Npy("<f4", "(4,)", data))), HasSubstr("shape"));
  EXPECT_THAT(ReasonOf(Write("a.npy", Npy("<f4", "(2, 2, 1)", data))), HasSubstr("shape"));
  EXPECT_THAT(ReasonOf(Write("a.npy", Npy("<f4", "(0, 2)", data))), HasSubstr("0"));
  EXPECT_THAT(ReasonOf(Write("a.npy", Npy("<f4", "(-2, 2)", data))), HasSubstr("-2"));
  EXPECT_THAT(ReasonOf(Write("a.npy", Npy("<c8", "(2, 1)", data))), HasSubstr("<c8"));
  EXPECT_THAT(ReasonOf(Write("a.pfm", "PF\n2 2\n-1\n" + data)), HasSubstr("one channel"));
  EXPECT_THAT(ReasonOf(Write("a.pfm", "Pf\n2 2\n-1\n" + data.substr(1))), HasSubstr("truncated"));
  EXPECT_THAT(ReasonOf(Write("a.pfm", "Pf\n2 2\n")), HasSubstr("header"));
  EXPECT_THAT(ReasonOf(Write("a.pfm", "Pf\n2 2\n-1.0")), HasSubstr("header"));
  EXPECT_THAT(ReasonOf(Write("a.bin", "2&2&3&" + data)), HasSubstr("COLMAP"));
  EXPECT_THAT(ReasonOf(Write("a.bin", "2&3&1&" + data)), HasSubstr("truncated"));
  EXPECT_THAT(ReasonOf(Write("a.png", "no picture")), HasSubstr("decoded"));
  EXPECT_THAT(ReasonOf(Write("a.exr", data)), HasSubstr("unknown"));
}

TEST_F(ReadDepthMapTest, NothingValidIsAnError) {
  const std::string data = Bytes<float>({0, -1, NAN, INFINITY});
  EXPECT_THAT(ReasonOf(Write("a.npy", Npy("<f4", "(2, 2)", data))), HasSubstr("no valid value"));
}

TEST_F(ReadDepthMapTest, MapsAreFoundByImageName) {
  const std::string folder = folder_.path();
  EXPECT_FALSE(FindDepthMap(folder, "0000.jpg"));
  EXPECT_FALSE(FindDepthMap(folder + "/absent", "0000.jpg"));
  const std::string pfm = Write("0000.jpg.pfm", "x");
  EXPECT_EQ(FindDepthMap(folder, "0000.jpg"), pfm);
  const std::string npy = Write("0000.jpg.npy", "x");
  EXPECT_EQ(FindDepthMap(folder, "0000.jpg"), npy);
}

TEST(DepthMapFromValues, Kinds) {
  const std::vector<float> values = {0.5f, 2.f};
  DepthOptions options;
  EXPECT_THAT(DepthMapFromValues(2, 1, values, options).values, ElementsAre(0.5f, 2.f));
  options.kind = DepthKind::kInverse;
  EXPECT_TRUE(DepthMapFromValues(2, 1, values, options).is_inverse);
  options.scale = 0.25;
  EXPECT_THAT(DepthMapFromValues(2, 1, values, options).values, ElementsAre(0.125f, 0.5f));
  options.kind = DepthKind::kLog;
  options.scale = 1;
  EXPECT_THAT(DepthMapFromValues(2, 1, values, options).values,
              ElementsAre(std::exp(0.5f), std::exp(2.f)));
}

TEST(DepthMapFromValues, ImpossibleValuesAreMissing) {
  const std::vector<float> values = {0, -1, NAN, INFINITY, -INFINITY, 1e-42f, 1};
  const int n = static_cast<int>(values.size());
  DepthOptions options;
  EXPECT_THAT(DepthMapFromValues(n, 1, values, options).is_valid, ElementsAre(0, 0, 0, 0, 0, 0, 1));
  options.kind = DepthKind::kInverse;  // Less than zero may be for want of a shift.
  EXPECT_THAT(DepthMapFromValues(n, 1, values, options).is_valid, ElementsAre(0, 1, 0, 0, 0, 0, 1));
  options.kind = DepthKind::kLog;  // A logarithm may be negative or zero.
  EXPECT_THAT(DepthMapFromValues(n, 1, values, options).is_valid, ElementsAre(1, 1, 0, 0, 0, 1, 1));
  EXPECT_THROW(DepthMapFromValues(3, 3, values, options), BugError);
  options.kind = static_cast<DepthKind>(9);
  EXPECT_THROW(DepthMapFromValues(n, 1, values, options), ConfigError);
}

}  // namespace
}  // namespace cairn
