#include "global_sfm/image_ids.h"

#include "cairn/base/error.h"
#include "support/test.h"
#include "support/thrown_message.h"

namespace cairn {
namespace {

// Two images that see one point.
Reconstruction Model() {
  Reconstruction model;
  model.cameras[1] = Camera::FromFocal(1, CameraModel::kPinhole, 500, 640, 480);
  for (const image_t id : {7, 9}) {
    const std::string name = id == 7 ? "a.jpg" : "b.jpg";
    model.images[id] = {{id, name, 1}, {}, {{1.0 * id, 2}}, {kInvalidPoint3DId}};
  }
  model.AddPoint3D({{0, 0, 5}, {}, -1, {{7, 0}, {9, 0}}});
  return model;
}

TEST(WithImageIdsOf, NamesDecide) {
  const std::vector<Image> images = {{2, "b.jpg", 3}, {4, "a.jpg", 3}, {5, "c.jpg", 3}};
  const Reconstruction model = WithImageIdsOf(images, Model());
  ASSERT_EQ(model.images.size(), 2u);
  EXPECT_EQ(model.images.at(2).image.name, "b.jpg");
  EXPECT_EQ(model.images.at(2).image.image_id, 2u);
  EXPECT_EQ(model.images.at(2).image.camera_id, 1u);
  EXPECT_EQ(model.images.at(4).points2D[0].x(), 7);
  EXPECT_EQ(model.points3D.begin()->second.track, (Track{{2, 0}, {4, 0}}));
}

TEST(WithImageIdsOf, ImagesThatAreNotThereAreNamed) {
  const std::vector<Image> images = {{2, "b.jpg", 3}};
  EXPECT_THAT(ThrownMessage<ConfigError>([&] { WithImageIdsOf(images, Model()); }),
              HasSubstr("model_path: a.jpg is not in the database"));
}

}  // namespace
}  // namespace cairn
