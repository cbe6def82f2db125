#include <array>
#include <cstring>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <set>

#include "cairn/base/error.h"
#include "cairn/base/file.h"
#include "cairn/io/colmap_model.h"
#include "cairn/io/gltf.h"
#include "cairn/io/model.h"
#include "cairn/io/ply.h"
#include "cairn/io/transforms_json.h"
#include "random_reconstruction.h"
#include "support/temp_folder.h"
#include "support/test.h"
#include "support/thrown_message.h"

namespace cairn {
namespace {

using Color = std::array<uint8_t, 3>;
constexpr Color kOrange = {255, 128, 0};  // of a frustum

Color ColorAt(const std::string& bytes, size_t at) {
  Color color;
  std::memcpy(color.data(), bytes.substr(at, 3).data(), 3);
  return color;
}

template <class T>
std::pair<T, T> EdgeAt(const std::string& bytes, size_t at) {
  T ends[2];
  std::memcpy(ends, bytes.substr(at, sizeof(ends)).data(), sizeof(ends));
  return {ends[0], ends[1]};
}

// Of a camera whose center is the first of five vertices.
template <class T>
std::set<std::pair<T, T>> FrustumEdges(T center) {
  std::set<std::pair<T, T>> edges;
  for (T corner = 0; corner < 4; ++corner) {
    edges.insert({center, center + 1 + corner});
    edges.insert({center + 1 + corner, center + 1 + (corner + 1) % 4});
  }
  return edges;
}

struct PlyFile {
  std::string header;
  std::string body;
  Eigen::Vector3f Vertex(size_t i) const {
    Eigen::Vector3f v;
    std::memcpy(v.data(), &body[15 * i], 12);
    return v;
  }
};

PlyFile ReadPly(const std::string& path) {
  const std::string bytes = ReadFile(path);
  const size_t end = bytes.find("end_header\n") + 11;
  return {bytes.substr(0, end), bytes.substr(end)};
}

TEST(Ply, PointsAndFrusta) {
  const TempFolder folder;
  const Reconstruction r = RandomReconstruction(4, {.num_images = 2, .num_points = 10});
  WritePly(r, folder / "a.ply");
  const PlyFile ply = ReadPly(folder / "a.ply");
  EXPECT_THAT(ply.header, HasSubstr("element vertex 20\n"));  // 10 points + 2 * (center + corners)
  EXPECT_THAT(ply.header, HasSubstr("element edge 16\n"));
  ASSERT_EQ(ply.body.size(), 20u * 15 + 16 * 11);
  EXPECT_EQ(ply.Vertex(3), r.points3D.at(4).xyz.cast<float>());
  EXPECT_EQ(ColorAt(ply.body, 15 * 3 + 12), r.points3D.at(4).color);
  EXPECT_EQ(ColorAt(ply.body, 15 * 10 + 12), (Color{255, 0, 0}));  // a center
  EXPECT_EQ(ColorAt(ply.body, 15 * 11 + 12), kOrange);
  std::set<std::pair<int32_t, int32_t>> edges;
  for (size_t at = 20 * 15; at < ply.body.size(); at += 11) {
    edges.insert(EdgeAt<int32_t>(ply.body, at));
    EXPECT_EQ(ColorAt(ply.body, at + 8), kOrange);
  }
  auto expected = FrustumEdges<int32_t>(10);
  expected.merge(FrustumEdges<int32_t>(15));
  EXPECT_EQ(edges, expected);
  const RegisteredImage& image = r.images.at(1);
  const double baseline =
      (image.cam_from_world.Center() - r.images.at(2).cam_from_world.Center()).norm();
  EXPECT_LT((ply.Vertex(10).cast<double>() - image.cam_from_world.Center()).norm(), 1e-5);
  for (int corner = 0; corner < 4; ++corner) {
    const Eigen::Vector3d x =
        image.cam_from_world * Eigen::Vector3d(ply.Vertex(11 + corner).cast<double>());
    EXPECT_NEAR(x.z(), 0.2 * baseline, 1e-5);
    EXPECT_NEAR(std::abs(x.x() / x.z()), 400 / r.CameraOf(image).FocalX(), 1e-5);
    EXPECT_NEAR(std::abs(x.y() / x.z()), 300 / r.CameraOf(image).FocalY(), 1e-5);
  }
}

TEST(Ply, CamerasCanBeLeftOut) {
  const TempFolder folder;
  const Reconstruction r = RandomReconstruction(4, {.num_images = 3, .num_points = 10});
  WritePly(r, folder / "a.ply", {.cameras = false});
  EXPECT_EQ(ReadPly(folder / "a.ply").body.size(), 10u * 15);
  WritePly({}, folder / "a.ply");
  EXPECT_EQ(ReadPly(folder / "a.ply").body.size(), 0u);
}

TEST(Ply, FrustaScaleWithTheScene) {
  const TempFolder folder;
  Reconstruction r = RandomReconstruction(4, {.num_images = 5, .num_points = 0});
  const auto depth = [&] {
    WritePly(r, folder / "a.ply");
    const PlyFile ply = ReadPly(folder / "a.ply");
    return (r.images.at(1).cam_from_world * Eigen::Vector3d(ply.Vertex(1).cast<double>())).z();
  };
  const double before = depth();
  EXPECT_GT(before, 0);
  r.Transform({.scale = 10});
  EXPECT_NEAR(depth(), 10 * before, 1e-4 * before);
}

TEST(TransformsJson, ProjectsAsOpenGlCameras) {
  const TempFolder folder;
  const Reconstruction r = RandomReconstruction(4, {.pixel_noise = 0.0});
  WriteTransformsJson(r, folder / "transforms.json", "../images", "points.ply");
  const auto json = nlohmann::json::parse(ReadFile(folder / "transforms.json"));
  EXPECT_EQ(json["camera_model"], "OPENCV");
  EXPECT_EQ(json["ply_file_path"], "points.ply");
  EXPECT_EQ(json["applied_transform"],
            nlohmann::json::parse("[[1.0,0.0,0.0,0.0],[0.0,1.0,0.0,0.0],[0.0,0.0,1.0,0.0]]"));
  ASSERT_EQ(json["frames"].size(), r.images.size());
  size_t i = 0;
  for (const auto& [id, image] : r.images) {
    const auto& frame = json["frames"][i++];
    EXPECT_EQ(frame["file_path"], "../images/" + image.image.name);
    EXPECT_EQ(frame["w"], 800);
    Eigen::Matrix4d world_from_gl;
    for (int k = 0; k < 16; ++k)
      world_from_gl(k / 4, k % 4) = frame["transform_matrix"][k / 4][k % 4];
    for (size_t p = 0; p < image.points2D.size(); ++p) {
      if (image.point3D_ids[p] == kInvalidPoint3DId) continue;
      const Eigen::Vector3d x =
          (world_from_gl.inverse() * r.points3D.at(image.point3D_ids[p]).xyz.homogeneous())
              .head<3>();
      const double u = x.x() / -x.z(), v = -x.y() / -x.z(), r2 = u * u + v * v;
      const double k1 = frame["k1"], k2 = frame["k2"], p1 = frame["p1"], p2 = frame["p2"];
      const double radial = 1 + k1 * r2 + k2 * r2 * r2;
      const Eigen::Vector2d pixel(
          frame["fl_x"].get<double>() * (u * radial + 2 * p1 * u * v + p2 * (r2 + 2 * u * u)) +
              frame["cx"].get<double>(),
          frame["fl_y"].get<double>() * (v * radial + 2 * p2 * u * v + p1 * (r2 + 2 * v * v)) +
              frame["cy"].get<double>());
      EXPECT_LT((pixel - image.points2D[p]).norm(), 1e-8);
    }
  }
}

// One camera of each of two models, and what the file says about them.
TEST(TransformsJson, FisheyesAndWhatDoesNotFit) {
  const TempFolder folder;
  const auto write = [&](const std::vector<CameraModel>& models, std::string* camera_model) {
    Reconstruction r;
    for (size_t i = 0; i < models.size(); ++i) {
      const auto id = static_cast<camera_t>(i + 1);
      r.cameras[id] = Camera::FromFocal(id, models[i], 300, 800, 600);
      const std::vector<int> distortion = r.cameras[id].DistortionIndices();
      if (!distortion.empty()) r.cameras[id].params[distortion[0]] = 0.25;
      r.images[id].image = {id, "image.jpg", id};
    }
    const auto warnings = WriteTransformsJson(r, folder / "transforms.json", "");
    const auto json = nlohmann::json::parse(ReadFile(folder / "transforms.json"));
    *camera_model = json["camera_model"];
    if (*camera_model == "OPENCV_FISHEYE") {
      EXPECT_EQ(json["frames"][0]["k1"], 0.25);
      EXPECT_EQ(json["frames"][0]["k4"], 0.0);
      EXPECT_FALSE(json["frames"][0].contains("p1"));
    }
    return warnings;
  };
  std::string model;
  EXPECT_THAT(write({CameraModel::kRadialFisheye, CameraModel::kOpenCVFisheye}, &model), IsEmpty());
  EXPECT_EQ(model, "OPENCV_FISHEYE");
  EXPECT_THAT(write({CameraModel::kEquirectangular}, &model), IsEmpty());
  EXPECT_EQ(model, "EQUIRECTANGULAR");
  // nerfstudio's longitude is pi (x - cx) / fl_x, its latitude pi (y - cy) / fl_y.
  const auto frame = nlohmann::json::parse(ReadFile(folder / "transforms.json"))["frames"][0];
  EXPECT_EQ(frame["fl_x"], 400);
  EXPECT_EQ(frame["fl_y"], 600);
  EXPECT_EQ(frame["cx"], 400);
  EXPECT_EQ(frame["cy"], 300);
  EXPECT_THAT(write({CameraModel::kOpenCV, CameraModel::kSimpleFisheye}, &model),
              ElementsAre(AllOf(HasSubstr("SIMPLE_FISHEYE"), HasSubstr("one model"))));
  EXPECT_EQ(model, "OPENCV");
  EXPECT_THAT(write({CameraModel::kFov}, &model),
              ElementsAre(AllOf(HasSubstr("FOV"), HasSubstr("left out"), HasSubstr("undistort"))));
}

// The chunks of a binary glTF file.
struct GlbFile {
  nlohmann::json json;
  std::string bin;
};

GlbFile ReadGlb(const std::string& path) {
  const std::string bytes = ReadFile(path);
  const auto word = [&](size_t at) {
    uint32_t value = 0;
    std::memcpy(&value, bytes.data() + at, 4);
    return value;
  };
  EXPECT_EQ(bytes.substr(0, 4), "glTF");
  EXPECT_EQ(word(4), 2u);
  EXPECT_EQ(word(8), bytes.size());
  EXPECT_EQ(bytes.substr(16, 4), "JSON");
  EXPECT_EQ(word(12) % 4, 0u);
  GlbFile file{nlohmann::json::parse(bytes.substr(20, word(12))), ""};
  const size_t bin = 20 + word(12);
  if (bin == bytes.size()) return file;
  EXPECT_EQ(bytes.substr(bin + 4, 4), std::string("BIN\0", 4));
  file.bin = bytes.substr(bin + 8);
  EXPECT_EQ(file.bin.size(), word(bin));
  EXPECT_EQ(file.bin.size(), file.json["buffers"][0]["byteLength"]);
  return file;
}

TEST(Gltf, HoldsPointsFrustaAndCameras) {
  const TempFolder folder;
  const Reconstruction r = RandomReconstruction(4, {.num_images = 3, .num_points = 10});
  WriteGltf(r, folder / "model.glb");
  const GlbFile file = ReadGlb(folder / "model.glb");
  ASSERT_EQ(file.json["meshes"].size(), 2u);
  const auto accessor = [&](int mesh, const char* attribute) {
    return file
        .json["accessors"]
             [file.json["meshes"][mesh]["primitives"][0]["attributes"][attribute].get<int>()];
  };
  EXPECT_EQ(accessor(0, "POSITION")["count"], 10);
  EXPECT_EQ(accessor(1, "POSITION")["count"], 15);
  // Every accessor lies within its view, and holds what it says.
  for (const auto& item : file.json["accessors"]) {
    const auto& view = file.json["bufferViews"][item["bufferView"].get<int>()];
    const size_t size = item["type"] == "VEC3" ? 12 : 4;
    EXPECT_LE(item["byteOffset"].get<size_t>() + size * item["count"].get<size_t>(),
              view["byteLength"].get<size_t>());
    EXPECT_LE(view["byteOffset"].get<size_t>() + view["byteLength"].get<size_t>(), file.bin.size());
    // Two accessors share a view of vertices: glTF then wants its stride.
    EXPECT_EQ(view.value("byteStride", size_t{0}), item["type"] == "SCALAR" ? 0 : size);
  }
  float xyz[3];
  std::memcpy(xyz, file.bin.data() + accessor(0, "POSITION")["byteOffset"].get<size_t>(), 12);
  for (int i = 0; i < 3; ++i) {
    EXPECT_EQ(xyz[i], static_cast<float>(r.points3D.begin()->second.xyz[i]));
    EXPECT_LE(accessor(0, "POSITION")["min"][i].get<float>(), xyz[i]);
    EXPECT_GE(accessor(0, "POSITION")["max"][i].get<float>(), xyz[i]);
  }
  const auto offset = [&](const auto& item) {  // in the buffer
    const auto& view = file.json["bufferViews"][item["bufferView"].template get<int>()];
    return view["byteOffset"].template get<size_t>() + item["byteOffset"].template get<size_t>();
  };
  EXPECT_EQ(ColorAt(file.bin, offset(accessor(0, "COLOR_0")) + 4), r.points3D.at(2).color);
  EXPECT_EQ(ColorAt(file.bin, offset(accessor(1, "COLOR_0")) + 4), kOrange);
  const auto& primitive = file.json["meshes"][1]["primitives"][0];
  const auto& ends = file.json["accessors"][primitive["indices"].get<int>()];
  EXPECT_EQ(ends["count"], 3 * 16);
  std::set<std::pair<uint32_t, uint32_t>> edges, expected;
  for (uint32_t i = 0; i < 24; ++i) {
    edges.insert(EdgeAt<uint32_t>(file.bin, offset(ends) + 8 * i));
    if (i % 8 == 0) expected.merge(FrustumEdges<uint32_t>(i / 8 * 5));
  }
  EXPECT_EQ(edges, expected);
  // Two nodes for the meshes, then the cameras, which look along -z with y up.
  ASSERT_EQ(file.json["nodes"].size(), 2u + 3);
  const auto& node = file.json["nodes"][2];
  const RegisteredImage& image = r.images.begin()->second;
  EXPECT_EQ(node["name"], image.image.name);
  Eigen::Matrix4d world_from_gl;
  for (int i = 0; i < 16; ++i) world_from_gl(i % 4, i / 4) = node["matrix"][i];
  const Eigen::Vector4d ahead = world_from_gl * Eigen::Vector4d(0, 0, -2, 1);
  EXPECT_LT(
      (image.cam_from_world * Eigen::Vector3d(ahead.head<3>()) - Eigen::Vector3d(0, 0, 2)).norm(),
      1e-9);
  const Camera& camera = r.CameraOf(image);
  const auto& lens = file.json["cameras"][node["camera"].get<int>()]["perspective"];
  EXPECT_NEAR(std::tan(lens["yfov"].get<double>() / 2), 0.5 * camera.height / camera.FocalY(),
              1e-9);
}

TEST(Gltf, AnEmptyModelIsAnEmptyScene) {
  const TempFolder folder;
  WriteGltf({}, folder / "model.glb");
  EXPECT_FALSE(ReadGlb(folder / "model.glb").json.contains("buffers"));
}

TEST(Export, UnwritablePlacesAreErrorsAndLeaveNothing) {
  const TempFolder folder;
  const Reconstruction r = RandomReconstruction(4);
  EXPECT_THROW(WritePly(r, folder / "absent/a.ply"), IoError);
  EXPECT_THROW(WriteTransformsJson(r, folder / "absent/a.json", ""), IoError);
  EXPECT_TRUE(std::filesystem::is_empty(folder.path()));
}

TEST(TransformsJson, NamesThatAreNoTextAreAWarning) {
  const TempFolder folder;
  Reconstruction r = RandomReconstruction(3);
  const size_t num_warnings = WriteTransformsJson(r, folder / "a.json", "").size();
  r.images.begin()->second.image.name = "a\xff.jpg";
  const auto warnings = WriteTransformsJson(r, folder / "a.json", "");
  ASSERT_EQ(warnings.size(), num_warnings + 1);
  EXPECT_THAT(warnings.back(), HasSubstr("1 image names are no UTF-8"));
}

TEST(ReadModel, TakesTheLargestModelOfAFolder) {
  const TempFolder folder;
  WriteColmapModel(RandomReconstruction(4), folder / "sparse/0");
  WriteColmapModel({}, folder / "sparse/1");
  const size_t num_images = RandomReconstruction(4).images.size();
  for (const char* path : {"", "sparse/0", "/", "sparse"}) {
    EXPECT_EQ(ReadModel(folder / path).images.size(), num_images) << path;
  }
  WriteColmapModel(RandomReconstruction(4), folder / "dense/sparse");
  EXPECT_EQ(ReadModel(folder / "dense").images.size(), num_images);
  WriteColmapModel({}, folder.path());
  EXPECT_TRUE(ReadModel(folder.path()).images.empty());
}

TEST(ReadModel, WhatIsNoModelIsNamed) {
  const TempFolder folder;
  EXPECT_THROW(ReadModel(folder / "absent"), IoError);
  EXPECT_THAT(ThrownMessage<IoError>([&] { ReadModel(folder.path()); }),
              HasSubstr("neither a COLMAP model"));
}

}  // namespace
}  // namespace cairn
