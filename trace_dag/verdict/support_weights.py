"""How often each fact of a report came out so, in true reports at their places and in controls.

Written by ``benchmarks/fit_support.py``, measured on FARS reports of Virginia 2023 and of Arizona, California, Ohio and
South Dakota 2012 to 2016. A module and no file beside, so that a verdict's fingerprint covers it.
"""

COUNTS = """\
fact,agreement,true_count,true_of,chance_count,chance_of
alignment,agrees,21,27,90,148
alignment,near,4,27,32,148
alignment,differs,2,27,26,148
carriageways,agrees,2,2,7,12
carriageways,differs,0,2,5,12
control,agrees,12,14,65,76
control,differs,2,14,11,76
crash type,agrees,38,38,205,754
crash type,differs,0,38,549,754
critical event,agrees,21,23,174,424
critical event,differs,2,23,250,424
damage,agrees,19,21,269,405
damage,near,1,21,69,405
damage,differs,1,21,67,405
division,agrees,12,14,52,82
division,differs,2,14,30,82
first harmful event,agrees,20,20,373,400
first harmful event,differs,0,20,27,400
first street,agrees,11,11,4,75
first street,near,0,11,2,75
first street,differs,0,11,69,75
impact,agrees,30,39,241,785
impact,near,9,39,300,785
impact,differs,0,39,244,785
intersection,agrees,18,20,71,130
intersection,near,2,20,18,130
intersection,differs,0,20,41,130
land use,agrees,17,19,86,123
land use,near,1,19,6,123
land use,differs,1,19,31,123
lanes,agrees,15,17,53,87
lanes,differs,2,17,34,87
limit,agrees,9,10,24,57
limit,differs,1,10,33,57
manner of collision,agrees,20,20,239,372
manner of collision,differs,0,20,133,372
movement,agrees,30,30,454,579
movement,differs,0,30,125,579
point,agrees,17,20,112,130
point,near,3,20,10,130
point,differs,0,20,8,130
road class,agrees,14,20,46,128
road class,near,5,20,32,128
road class,differs,1,20,50,128
second street,agrees,7,8,2,61
second street,differs,1,8,59,61
travel speed,agrees,38,38,90,683
travel speed,differs,0,38,593,683
"""
