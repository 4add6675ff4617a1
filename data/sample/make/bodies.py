"""The vehicles of the sample: outer dimensions of their kind, FARS body types, makes and models that exist."""

from __future__ import annotations

from make.motion import Body, Pulled

SEDAN = Body("car", 4.88, 1.84, 1.45, 1540, 4, (49, "Toyota"), (40, "Camry"))
COMPACT = Body("car", 4.63, 1.78, 1.43, 1310, 4, (49, "Toyota"), (32, "Corolla"))
HATCHBACK = Body("car", 4.35, 1.79, 1.48, 1290, 5, (55, "Hyundai"), (35, "Elantra"))
WAGON = Body("car", 4.82, 1.85, 1.65, 1650, 6, (48, "Subaru"), (45, "Outback (2003 on)(see 034 for prior to 2003)"))
SUV = Body("suv", 4.62, 1.86, 1.69, 1570, 14, (37, "Honda"), (402, "CR-V"))
LARGE_SUV = Body("suv", 5.18, 2.04, 1.89, 2500, 15, (20, "Chevrolet"), (421, "Fullsize Blazer/Tahoe"))
PICKUP = Body("pickup", 5.89, 2.03, 1.96, 2150, 34, (12, "Ford"), (481, "F-Series pickup"))
MINIVAN = Body("van", 5.16, 2.00, 1.77, 2050, 20, (37, "Honda"), (441, "Odyssey"))
MOTORCYCLE = Body("motorcycle", 2.25, 0.85, 1.20, 340, 80, (72, "Harley-Davidson"), (706, "750cc or greater"))
BOX_TRUCK = Body("truck", 8.50, 2.44, 3.50, 9000, 62, (82, "Freightliner"), (898, "Other (medium/heavy truck)"))
DUMP_TRUCK = Body("truck", 8.80, 2.50, 3.20, 16000, 63, (86, "Mack"), (881, "Medium/Heavy - CBE"))
TRACTOR_TRAILER = Body(
    "tractor_trailer", 7.0, 2.50, 3.90, 8500, 66, (82, "Freightliner"), (881, "Medium/Heavy - CBE"), trailers=1,
    pulled=Pulled(16.15, 2.59, kingpin_m=0.91, axle_m=13.2, coupled_m=6.0),
)  # fmt: skip
SCHOOL_BUS = Body(
    "bus", 11.0, 2.44, 3.10, 12500, 50, (84, "International Harvester/Navistar"),
    (981, "Bus**: Conventional (Engine out front)"),
)  # fmt: skip
TRANSIT_BUS = Body(
    "bus", 12.2, 2.59, 3.20, 14500, 52, (98, "Other Make"), (983, "Bus**: Rear engine, flat front")
)  # fmt: skip
